/* With sweeps.c the only place that sees the headers of PETSc and MPI: handles of MPI (pointers in Open MPI, integers in
   MPICH) never cross into Rust, and the sizes that src/ffi.rs relies on are asserted. Every function that returns an int returns 0, or
   an error whose text wfl_last_error() gives. All of them are collective over the ranks of the run. */
#include <petscksp.h>
#ifdef __GLIBC__
#include <malloc.h>
#endif
#include <stdlib.h>

#include "sweeps.h"

_Static_assert(sizeof(PetscInt) == 4, "PETSc with 32-bit indices is needed");
_Static_assert(sizeof(PetscScalar) == 8, "PETSc with real numbers of double precision is needed");
_Static_assert(sizeof(PetscErrorCode) == 4, "PetscErrorCode is an int");
_Static_assert(PETSC_VERSION_GE(3, 18, 0), "PETSc 3.18 or newer is needed");

/* Smoothed aggregation as measured in docs/scale.md; the direct solvers report null pivots (ICNTL(24)) and have room for
   pivoting (ICNTL(14), in per cent). */
static const char *const options =
  " -wfl_lu_ksp_type preonly -wfl_lu_pc_type lu -wfl_lu_pc_factor_mat_solver_type mumps"
  " -wfl_lu_mat_mumps_icntl_24 1 -wfl_lu_mat_mumps_icntl_14 80"
  " -wfl_cholesky_ksp_type preonly -wfl_cholesky_pc_type cholesky -wfl_cholesky_pc_factor_mat_solver_type mumps"
  " -wfl_cholesky_mat_mumps_icntl_24 1 -wfl_cholesky_mat_mumps_icntl_14 80"
  " -wfl_filter_ksp_type preonly -wfl_filter_pc_type lu -wfl_filter_pc_factor_mat_solver_type mumps"
  " -wfl_filter_mat_mumps_icntl_14 80"
  " -wfl_cg_ksp_type cg -wfl_cg_ksp_norm_type unpreconditioned"
  " -wfl_gmres_ksp_type gmres -wfl_gmres_ksp_pc_side right -wfl_gmres_ksp_gmres_restart 100"
  " -wfl_gmres_ksp_norm_type unpreconditioned"
  " -wfl_cycle_pc_type gamg -wfl_cycle_pc_gamg_agg_nsmooths 1 -wfl_cycle_pc_gamg_threshold 0.01"
  " -wfl_cycle_pc_gamg_coarse_eq_limit 500 -wfl_cycle_mg_levels_ksp_type chebyshev"
  " -wfl_cycle_mg_levels_pc_type jacobi -wfl_cycle_mg_levels_ksp_max_it 2"
  /* three dimensions: the threshold of hypre's manual */
  " -wfl_boomeramg_pc_type hypre -wfl_boomeramg_pc_hypre_type boomeramg"
  " -wfl_boomeramg_pc_hypre_boomeramg_strong_threshold 0.5";

/* The same bits in every run on so many ranks: MUMPS orders its sums by the arrival of messages, so each rank makes a
   whole factor for itself. The products that make the levels have the same bits one way alone, three to five times as slow
   as the others. */
static const char *const repeatable =
  " -matptap_via allatonce"
  " -wfl_lu_pc_type redundant -wfl_lu_redundant_pc_type lu -wfl_lu_redundant_pc_factor_mat_solver_type mumps"
  " -wfl_lu_redundant_mat_mumps_icntl_24 1 -wfl_lu_redundant_mat_mumps_icntl_14 80"
  " -wfl_cholesky_pc_type redundant -wfl_cholesky_redundant_pc_type cholesky"
  " -wfl_cholesky_redundant_pc_factor_mat_solver_type mumps"
  " -wfl_cholesky_redundant_mat_mumps_icntl_24 1 -wfl_cholesky_redundant_mat_mumps_icntl_14 80"
  " -wfl_filter_pc_type redundant -wfl_filter_redundant_pc_type lu"
  " -wfl_filter_redundant_pc_factor_mat_solver_type mumps -wfl_filter_redundant_mat_mumps_icntl_14 80";

/* Errors are told once, by Rust: PETSc returns codes and prints nothing. The first text of a failure is kept. */
static char last[1024];

static PetscErrorCode keep(MPI_Comm comm, int line, const char *function, const char *file, PetscErrorCode n,
                           PetscErrorType p, const char *text, void *context)
{
  (void)comm;
  (void)line;
  (void)file;
  (void)context;
  if (p == PETSC_ERROR_INITIAL) snprintf(last, sizeof last, "%s: %s", function, text ? text : "");
  return n;
}

const char *wfl_last_error(void) { return last; }

int wfl_start(int is_repeatable, int *rank, int *size)
{
  int provided, is_running;
  /* one thread of a rank at a time calls, but not always the same one: threads of their own libraries are turned off */
  setenv("OMP_NUM_THREADS", "1", 0);
  setenv("SCOTCH_PTHREAD_NUMBER", "1", 0);
  MPI_Initialized(&is_running);
  if (is_running) MPI_Query_thread(&provided);
  else if (MPI_Init_thread(NULL, NULL, MPI_THREAD_SERIALIZED, &provided)) return 1;
  if (provided < MPI_THREAD_SERIALIZED) {
    snprintf(last, sizeof last, "this MPI lets one thread alone call it; one with MPI_THREAD_SERIALIZED is needed");
    return 1;
  }
  PetscCall(PetscInitializeNoArguments());
  PetscCall(PetscPopSignalHandler()); /* signals are the program's */
  PetscCall(PetscPushErrorHandler(keep, NULL));
  PetscCall(PetscOptionsInsertString(NULL, options));
  MPI_Comm_rank(PETSC_COMM_WORLD, rank);
  MPI_Comm_size(PETSC_COMM_WORLD, size);
  if (*size > 1 && is_repeatable) PetscCall(PetscOptionsInsertString(NULL, repeatable));
  /* what a user asks for goes before what stands above */
  if (getenv("PETSC_OPTIONS")) PetscCall(PetscOptionsInsertString(NULL, getenv("PETSC_OPTIONS")));
  return 0;
}

/* Ends all ranks at once. */
void wfl_abort(int code) { MPI_Abort(PETSC_COMM_WORLD, code); }

/* Sums, and largest numbers, over all ranks, in place. Errors end all ranks, as MPI does by itself. */
void wfl_sum(double *values, int n)
{
  /* each rank decides from sums by itself, so all need the same bits: MPI promises them of a broadcast, and only recommends
     them of MPI_Allreduce (MPI 4.1, 6.9.1) */
  int rank;
  MPI_Comm_rank(PETSC_COMM_WORLD, &rank);
  (void)MPI_Reduce(rank ? values : MPI_IN_PLACE, rank ? NULL : values, n, MPI_DOUBLE, MPI_SUM, 0, PETSC_COMM_WORLD);
  (void)MPI_Bcast(values, n, MPI_DOUBLE, 0, PETSC_COMM_WORLD);
}

void wfl_sum_words(unsigned long long *words, int n)
{
  MPI_Allreduce(MPI_IN_PLACE, words, n, MPI_UNSIGNED_LONG_LONG, MPI_SUM, PETSC_COMM_WORLD);
}

void wfl_max_words(unsigned long long *words, int n)
{
  MPI_Allreduce(MPI_IN_PLACE, words, n, MPI_UNSIGNED_LONG_LONG, MPI_MAX, PETSC_COMM_WORLD);
}

/* Words for a rank, or room for those of one. */
typedef struct {
  int rank, n;
  unsigned long long *to;
  const unsigned long long *from;
} Message;

/* Sends and receives between some ranks; each pair has one message in each direction at most. */
void wfl_exchange(const Message *messages, int n)
{
  MPI_Request *requests = malloc((n > 0 ? n : 1) * sizeof *requests);
  if (!requests) {
    MPI_Abort(PETSC_COMM_WORLD, 1);
    return;
  }
  for (int k = 0; k < n; k++) {
    const Message m = messages[k];
    if (m.to) (void)MPI_Irecv(m.to, m.n, MPI_UNSIGNED_LONG_LONG, m.rank, 0, MPI_COMM_WORLD, &requests[k]);
    else (void)MPI_Isend(m.from, m.n, MPI_UNSIGNED_LONG_LONG, m.rank, 0, MPI_COMM_WORLD, &requests[k]);
  }
  (void)MPI_Waitall(n, requests, MPI_STATUSES_IGNORE);
  free(requests);
}

/* Gives memory that is not used any more back to the system, where the allocator of C keeps it. */
void wfl_trim_memory(void)
{
#ifdef __GLIBC__
  malloc_trim(0);
#endif
}

void wfl_finish(void)
{
  PetscFinalize();
  MPI_Finalize();
}

/* Square; n rows of this rank, with so many entries in columns of this rank and of others by row. Without values. */
int wfl_matrix_new(PetscInt n, PetscInt block, int is_symmetric, const PetscInt *own, const PetscInt *others, Mat *out)
{
  PetscCall(MatCreate(PETSC_COMM_WORLD, out));
  PetscCall(MatSetSizes(*out, n, n, PETSC_DETERMINE, PETSC_DETERMINE));
  PetscCall(MatSetBlockSize(*out, block));
  PetscCall(MatSetType(*out, MATAIJ));
  PetscCall(MatSeqAIJSetPreallocation(*out, 0, own));
  PetscCall(MatMPIAIJSetPreallocation(*out, 0, own, 0, others));
  PetscCall(MatSetOption(*out, MAT_NEW_NONZERO_ALLOCATION_ERR, PETSC_TRUE));
  PetscCall(MatSetOption(*out, MAT_SYMMETRIC, is_symmetric ? PETSC_TRUE : PETSC_FALSE));
  return 0;
}

/* One row of this rank, its columns increasing; wfl_matrix_finish follows the last one. */
int wfl_matrix_put(Mat a, PetscInt row, PetscInt n, const PetscInt *columns, const double *values)
{
  PetscCall(MatSetValues(a, 1, &row, n, columns, values, INSERT_VALUES));
  return 0;
}

int wfl_matrix_finish(Mat a)
{
  PetscCall(MatAssemblyBegin(a, MAT_FINAL_ASSEMBLY));
  PetscCall(MatAssemblyEnd(a, MAT_FINAL_ASSEMBLY));
  return 0;
}

/* The near null space: k vectors of n numbers of this rank, one behind the other, made orthonormal here (modified
   Gram-Schmidt). One that depends on those before it is left out. */
int wfl_matrix_set_modes(Mat a, PetscInt n, PetscInt k, const double *values)
{
  Vec modes[6];
  PetscInt kept = 0;
  MatNullSpace space;
  if (k > 6) SETERRQ(PETSC_COMM_WORLD, PETSC_ERR_ARG_OUTOFRANGE, "at most six near null vectors");
  for (PetscInt m = 0; m < k; m++) {
    double *x, before, after;
    PetscCall(MatCreateVecs(a, &modes[kept], NULL));
    PetscCall(VecGetArrayWrite(modes[kept], &x));
    PetscCall(PetscArraycpy(x, values + (size_t)m * n, n));
    PetscCall(VecRestoreArrayWrite(modes[kept], &x));
    PetscCall(VecNorm(modes[kept], NORM_2, &before));
    for (PetscInt j = 0; j < kept; j++) {
      double product;
      PetscCall(VecDot(modes[kept], modes[j], &product));
      PetscCall(VecAXPY(modes[kept], -product, modes[j]));
    }
    PetscCall(VecNorm(modes[kept], NORM_2, &after));
    if (after > 1e-8 * before) {
      PetscCall(VecScale(modes[kept], 1.0 / after));
      kept++;
    } else PetscCall(VecDestroy(&modes[kept]));
  }
  PetscCall(MatNullSpaceCreate(PETSC_COMM_WORLD, PETSC_FALSE, kept, modes, &space));
  PetscCall(MatSetNearNullSpace(a, space));
  PetscCall(MatNullSpaceDestroy(&space));
  for (PetscInt m = 0; m < kept; m++) PetscCall(VecDestroy(&modes[m]));
  return 0;
}

void wfl_matrix_free(Mat *a) { MatDestroy(a); }

/* A Krylov method. Direct: its preconditioner is a factor. Otherwise it is a cycle of multigrid, followed by a direct
   solution on the unknowns of contact of what is left (AMGF, arXiv 2505.18576): of rows and part, the rows of contact
   and what they have in columns of contact. */
typedef struct {
  KSP ksp;
  PC cycle;
  Sweeps *sweeps; /* the smoother of the finest level of the cycle */
  int is_of_a;    /* the cycle was made of `a` */
  Mat a;          /* borrowed from the caller */
  IS contact, all;
  Mat rows, part;
  KSP filter;
  Vec left, rhs, correction, b, x;
} Solver;

static PetscErrorCode apply(PC pc, Vec x, Vec y)
{
  Solver *s;
  PetscCall(PCShellGetContext(pc, &s));
  PetscCall(PCApply(s->cycle, x, y));
  if (!s->contact) return 0;
  PetscCall(MatMult(s->rows, y, s->left));
  PetscCall(VecISCopy(x, s->contact, SCATTER_REVERSE, s->rhs));
  PetscCall(VecAXPY(s->rhs, -1.0, s->left));
  PetscCall(KSPSolve(s->filter, s->rhs, s->correction));
  PetscCall(VecISAXPY(y, s->contact, 1.0, s->correction));
  return 0;
}

/* kind: the prefix of its options. is_direct: no cycle. contact: numbers of this rank; none on any rank: no filter. */
int wfl_solver_new(const char *kind, int is_direct, Mat a, PetscInt n, const PetscInt *contact, int has_contact,
                   Solver **out)
{
  Solver *s = calloc(1, sizeof *s);
  if (!s) return PETSC_ERR_MEM;
  *out = s;
  s->a = a;
  PetscCall(MatCreateVecs(a, &s->x, &s->b));
  PetscCall(KSPCreate(PETSC_COMM_WORLD, &s->ksp));
  PetscCall(KSPSetOptionsPrefix(s->ksp, kind));
  if (!is_direct) {
    PC pc;
    PetscCall(KSPGetPC(s->ksp, &pc));
    PetscCall(PCSetType(pc, PCSHELL));
    PetscCall(PCShellSetContext(pc, s));
    PetscCall(PCShellSetApply(pc, apply));
  }
  PetscCall(KSPSetFromOptions(s->ksp));
  if (is_direct || !has_contact) return 0;
  PetscCall(ISCreateGeneral(PETSC_COMM_WORLD, n, contact, PETSC_COPY_VALUES, &s->contact));
  PetscCall(MatGetOwnershipIS(a, &s->all, NULL));
  PetscCall(KSPCreate(PETSC_COMM_WORLD, &s->filter));
  PetscCall(KSPSetOptionsPrefix(s->filter, "wfl_filter_"));
  PetscCall(KSPSetFromOptions(s->filter));
  return 0;
}

/* The preconditioner that makes the factor: that of this rank where each makes a whole one. */
static PetscErrorCode factor_of(KSP ksp, PC *pc)
{
  PetscBool is_redundant;
  PetscCall(KSPGetPC(ksp, pc));
  PetscCall(PetscObjectTypeCompare((PetscObject)*pc, PCREDUNDANT, &is_redundant));
  if (is_redundant) {
    KSP own;
    PetscCall(PCRedundantGetKSP(*pc, &own));
    PetscCall(KSPGetPC(own, pc));
  }
  return 0;
}

/* Gives back what products keep for being computed again: levels are made anew from nothing. */
static PetscErrorCode forget_products(PC cycle)
{
  PetscInt levels;
  PetscCall(PCMGGetLevels(cycle, &levels));
  for (PetscInt k = 0; k + 1 < levels; k++) {
    KSP smoother;
    Mat coarse, interpolation;
    PetscCall(PCMGGetSmoother(cycle, k, &smoother));
    PetscCall(KSPGetOperators(smoother, &coarse, NULL));
    PetscCall(MatProductClear(coarse));
    PetscCall(PCMGGetInterpolation(cycle, k + 1, &interpolation));
    PetscCall(MatProductClear(interpolation));
  }
  return 0;
}

int wfl_has_boomeramg(void)
{
#if defined(PETSC_HAVE_HYPRE)
  return 1;
#else
  return 0;
#endif
}

/* The values of the matrix have changed; hierarchy: what the levels are made of, or null to keep them; cycle: the prefix of
   the options of what makes them. reason: 0, or why a factor could not be made; null_pivots: found by a direct solver. */
int wfl_solver_take(Solver *s, Mat hierarchy, const char *cycle, int *reason, int *null_pivots)
{
  PC pc;
  PCFailedReason failed;
  *reason = *null_pivots = 0;
  if (hierarchy) {
    /* GAMG cannot take a matrix that coarsens otherwise: a new object, not one that is reset */
    PetscBool has_levels;
    PetscInt block;
    PetscCall(PCDestroy(&s->cycle));
    sweeps_free(s->sweeps);
    s->sweeps = NULL;
    s->is_of_a = hierarchy == s->a;
    PetscCall(PCCreate(PETSC_COMM_WORLD, &s->cycle));
    PetscCall(PCSetOptionsPrefix(s->cycle, cycle));
    PetscCall(PCSetOperators(s->cycle, hierarchy, hierarchy));
    PetscCall(PCSetFromOptions(s->cycle));
    PetscCall(PCSetUp(s->cycle));
    /* not those of hypre, nor what a user has put in place of them */
    PetscCall(PetscObjectTypeCompare((PetscObject)s->cycle, PCGAMG, &has_levels));
    if (has_levels) PetscCall(forget_products(s->cycle));
    /* where it is made of the matrix itself, its coarser levels stay as that gets other values */
    PetscCall(PCSetReusePreconditioner(s->cycle, PETSC_TRUE));
    PetscCall(MatGetBlockSize(hierarchy, &block));
    if (has_levels && block <= MOST_OF_A_NODE) {
      PetscCall(sweeps_new(hierarchy, &s->sweeps));
      PetscCall(sweeps_install(s->sweeps, s->cycle));
    }
  } else if (s->sweeps && s->is_of_a) PetscCall(sweeps_take(s->sweeps, s->a));
  if (s->contact) {
    const MatReuse reuse = s->part ? MAT_REUSE_MATRIX : MAT_INITIAL_MATRIX;
    PetscCall(MatCreateSubMatrix(s->a, s->contact, s->contact, reuse, &s->part));
    PetscCall(MatCreateSubMatrix(s->a, s->contact, s->all, reuse, &s->rows));
    if (!s->rhs) PetscCall(MatCreateVecs(s->part, &s->correction, &s->rhs));
    if (!s->left) PetscCall(VecDuplicate(s->rhs, &s->left));
    PetscCall(KSPSetOperators(s->filter, s->part, s->part));
    PetscCall(KSPSetUp(s->filter));
    PetscCall(factor_of(s->filter, &pc));
    PetscCall(PCGetFailedReason(pc, &failed));
    *reason = (int)failed;
  }
  PetscCall(KSPSetOperators(s->ksp, s->a, s->a));
  PetscCall(KSPSetUp(s->ksp));
  if (!s->cycle) {
    Mat factor;
    PetscInt pivots = 0;
    PetscCall(factor_of(s->ksp, &pc));
    PetscCall(PCGetFailedReason(pc, &failed));
    *reason = (int)failed;
    PetscCall(PCFactorGetMatrix(pc, &factor));
    PetscCall(MatMumpsGetInfog(factor, 28, &pivots));
    *null_pivots = (int)pivots;
  }
  return 0;
}

/* b and x: numbers of this rank. reason: positive where it converged. */
int wfl_solver_solve(Solver *s, PetscInt n, const double *b, double *x, double tolerance, PetscInt most, int *iterations,
                     int *reason)
{
  double *to;
  const double *from;
  PetscInt count;
  KSPConvergedReason why;
  PetscCall(VecGetArrayWrite(s->b, &to));
  PetscCall(PetscArraycpy(to, b, n));
  PetscCall(VecRestoreArrayWrite(s->b, &to));
  PetscCall(KSPSetTolerances(s->ksp, tolerance, 0.0, 1e10, most));
  PetscCall(KSPSolve(s->ksp, s->b, s->x));
  PetscCall(KSPGetIterationNumber(s->ksp, &count));
  PetscCall(KSPGetConvergedReason(s->ksp, &why));
  *iterations = (int)count;
  *reason = (int)why;
  PetscCall(VecGetArrayRead(s->x, &from));
  PetscCall(PetscArraycpy(x, from, n));
  PetscCall(VecRestoreArrayRead(s->x, &from));
  return 0;
}

void wfl_solver_free(Solver *s)
{
  KSPDestroy(&s->ksp);
  KSPDestroy(&s->filter);
  PCDestroy(&s->cycle);
  sweeps_free(s->sweeps);
  MatDestroy(&s->rows);
  MatDestroy(&s->part);
  ISDestroy(&s->contact);
  ISDestroy(&s->all);
  VecDestroy(&s->left);
  VecDestroy(&s->rhs);
  VecDestroy(&s->correction);
  VecDestroy(&s->b);
  VecDestroy(&s->x);
  free(s);
}
