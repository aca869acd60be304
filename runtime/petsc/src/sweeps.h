/* Sweeps of Gauss and Seidel over the nodes of a matrix, in place of the smoothers of PETSc on the finest level. */
#ifndef WFL_SWEEPS_H
#define WFL_SWEEPS_H
#include <petscksp.h>

typedef struct Sweeps Sweeps;

/* The most rows of a node. */
enum { MOST_OF_A_NODE = 3 };

/* A copy of a matrix whose block size is the number of rows of a node, at most MOST_OF_A_NODE. */
PetscErrorCode sweeps_new(Mat a, Sweeps **out);

/* Takes the values that the matrix has now; its entries are where they were. */
PetscErrorCode sweeps_take(Sweeps *s, Mat a);

/* Smooths with them on the finest level of a cycle that is set up: forwards before the correction by the coarser levels,
   backwards after it. The cycle borrows them, and has no matrix of that level any more. */
PetscErrorCode sweeps_install(Sweeps *s, PC cycle);

/* null is nothing to do. */
void sweeps_free(Sweeps *s);

#endif
