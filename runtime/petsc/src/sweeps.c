/* A matrix by nodes: blocks of single precision, one after the other, with one column number a block. It is read several
   times in a cycle, and the time of a cycle is that of reading it: 40 bytes for a block of three rows where PETSc's rows
   have 84 to 108. Sums are of double precision, so that a sweep is one linear map, to rounding; what single precision takes
   from the matrix, 6e-8 of its entries, a preconditioner may lack.

   A rank sweeps over its own nodes, with the values that nodes of others had before. To the diagonal half the sum of the
   entries in their columns is added, by absolute value: without it such sweeps may diverge (Baker, Falgout, Kolev and Yang,
   Multigrid smoothers for ultraparallel computing, 2011, section 6). A sweep backwards is the transposed of one forwards
   where the matrix is symmetric, so the cycle is symmetric, too. */
#include "sweeps.h"

#if defined(__x86_64__)
#include <immintrin.h>
#endif

/* Some blocks of the rows of this rank. */
typedef struct {
  PetscInt *start; /* by node, and one more */
  PetscInt *node;  /* by block, increasing in a row */
  float *value;    /* by block, column after column; of rows divided by their scale */
} Blocks;

struct Sweeps {
  PetscInt b, n; /* rows of a node, nodes of this rank */
  int is_wide;   /* the processor has AVX2 */
  /* In columns of nodes before, the diagonal included as the last of its row; in those of nodes behind; in those of
     other ranks. A sweep forwards reads the first alone, from one end to the other. */
  Blocks before, behind, others;
  double *scale;   /* by node: a power of two, as large as its largest entry */
  double *inverse; /* by node: that of the diagonal, column after column */
  VecScatter halo;
  Vec ghosts; /* values of nodes of other ranks, in the order of the columns of `others` */
  Mat shell;  /* stands for the matrix of the level */
};

/* The loops twice, for processors with AVX2 and for all: which of them run is found out once. GCC lowers vectors before it
   inlines, so each needs the instructions named at every function. */
#define INLINE static inline __attribute__((always_inline))
typedef float Floats __attribute__((vector_size(16)));
typedef double Doubles __attribute__((vector_size(32)));

#define FOR
#define NAME(name) name##_everywhere
#define AS_DOUBLES(floats) __builtin_convertvector(floats, Doubles)
#include "sweeps_loops.h"
#undef FOR
#undef NAME
#undef AS_DOUBLES

#if defined(__x86_64__)
#define FOR __attribute__((target("avx2,fma")))
#define NAME(name) name##_wide
/* GCC makes two halves of it otherwise */
#define AS_DOUBLES(floats) ((Doubles)_mm256_cvtps_pd((__m128)(floats)))
#include "sweeps_loops.h"
#undef FOR
#undef NAME
#undef AS_DOUBLES
#define BY_PROCESSOR(name, ...) (s->is_wide ? name##_wide(__VA_ARGS__) : name##_everywhere(__VA_ARGS__))
static int has_wide(void) { return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma"); }
#else
#define BY_PROCESSOR(name, ...) name##_everywhere(__VA_ARGS__)
static int has_wide(void) { return 0; }
#endif

/* A part of the rows of this rank. */
typedef struct {
  Mat a;                  /* null: it has no entries */
  int side;               /* 0: all of `a`; -1: columns of nodes up to that of the row; 1: those of nodes behind it */
  const PetscInt *places; /* by column: its node times b, and its place there; null: the column itself */
  PetscInt n_nodes;       /* that it has columns of */
} Part;

enum { BEFORE, BEHIND, OTHERS, PARTS };

/* The rows of a part. */
typedef struct {
  const PetscInt *start, *column;
  const double *value;
  PetscInt n;
} Rows;

static PetscErrorCode rows_open(const Part *part, Rows *rows)
{
  PetscBool done;
  PetscCall(MatGetRowIJ(part->a, 0, PETSC_FALSE, PETSC_FALSE, &rows->n, &rows->start, &rows->column, &done));
  if (!done) SETERRQ(PETSC_COMM_SELF, PETSC_ERR_SUP, "no rows of this kind of matrix");
  PetscCall(MatSeqAIJGetArrayRead(part->a, &rows->value));
  return 0;
}

static PetscErrorCode rows_close(const Part *part, Rows *rows)
{
  PetscBool done;
  PetscCall(MatSeqAIJRestoreArrayRead(part->a, &rows->value));
  PetscCall(MatRestoreRowIJ(part->a, 0, PETSC_FALSE, PETSC_FALSE, &rows->n, &rows->start, &rows->column, &done));
  return 0;
}

/* The parts of a matrix, with places of columns and nodes of other ranks, which are to be freed. */
static PetscErrorCode parts_of(Mat a, PetscInt b, PetscInt n, Part parts[PARTS], PetscInt **places, PetscInt **ghosts)
{
  PetscBool is_distributed;
  const PetscInt *columns;
  PetscInt count, *place, *ghost, n_ghosts = 0;
  Mat own = a, others = NULL;
  *places = *ghosts = NULL;
  PetscCall(PetscObjectTypeCompare((PetscObject)a, MATMPIAIJ, &is_distributed));
  if (is_distributed) PetscCall(MatMPIAIJGetSeqAIJ(a, &own, &others, &columns));
  parts[BEFORE] = (Part){own, -1, NULL, n};
  parts[BEHIND] = (Part){own, 1, NULL, n};
  parts[OTHERS] = (Part){others, 0, NULL, 0};
  if (!others) return 0;
  PetscCall(MatGetSize(others, NULL, &count));
  PetscCall(PetscMalloc1(count, &place));
  PetscCall(PetscMalloc1(count, &ghost));
  for (PetscInt k = 0; k < count; k++) {
    /* columns increase */
    if (n_ghosts == 0 || ghost[n_ghosts - 1] != columns[k] / b) ghost[n_ghosts++] = columns[k] / b;
    place[k] = b * (n_ghosts - 1) + columns[k] % b;
  }
  parts[OTHERS].places = *places = place;
  parts[OTHERS].n_nodes = n_ghosts;
  *ghosts = ghost;
  return 0;
}

/* The place of a column of a row of node i, or -1 where the part does not have it. */
static inline PetscInt place_of(const Part *part, PetscInt b, PetscInt i, PetscInt column)
{
  const PetscInt place = part->places ? part->places[column] : column;
  return part->side != 0 && (place >= b * (i + 1)) != (part->side > 0) ? -1 : place;
}

/* Where a part has blocks. */
static PetscErrorCode blocks_new(const Part *part, PetscInt b, PetscInt n, Blocks *out)
{
  PetscInt *seen, *found, count = 0;
  Rows rows;
  PetscCall(PetscCalloc1(n + 1, &out->start));
  if (!part->a) return 0;
  PetscCall(rows_open(part, &rows));
  PetscCall(PetscMalloc1(part->n_nodes, &seen));
  /* a block has an entry at least */
  PetscCall(PetscMalloc1(rows.start[rows.n], &found));
  for (PetscInt k = 0; k < part->n_nodes; k++) seen[k] = -1;
  for (PetscInt i = 0; i < n; i++) {
    for (PetscInt k = rows.start[b * i]; k < rows.start[b * (i + 1)]; k++) {
      const PetscInt place = place_of(part, b, i, rows.column[k]), node = place / b;
      if (place < 0 || seen[node] == i) continue;
      seen[node] = i;
      found[count++] = node;
    }
    PetscCall(PetscSortInt(count - out->start[i], found + out->start[i]));
    out->start[i + 1] = count;
  }
  PetscCall(PetscMalloc1(count, &out->node));
  PetscCall(PetscArraycpy(out->node, found, count));
  /* one more: a load of four floats goes beyond the last block */
  PetscCall(PetscCalloc1((size_t)count * (size_t)(b * b) + 1, &out->value));
  PetscCall(PetscFree(found));
  PetscCall(PetscFree(seen));
  PetscCall(rows_close(part, &rows));
  return 0;
}

static PetscErrorCode blocks_free(Blocks *blocks)
{
  PetscCall(PetscFree(blocks->start));
  PetscCall(PetscFree(blocks->node));
  PetscCall(PetscFree(blocks->value));
  return 0;
}

/* The largest entry of each node, where it is larger than what is there. */
static PetscErrorCode widen(const Part *part, PetscInt b, PetscInt n, double *largest)
{
  Rows rows;
  if (!part->a) return 0;
  PetscCall(rows_open(part, &rows));
  for (PetscInt i = 0; i < n; i++)
    for (PetscInt k = rows.start[b * i]; k < rows.start[b * (i + 1)]; k++)
      largest[i] = PetscMax(largest[i], PetscAbsReal(rows.value[k]));
  PetscCall(rows_close(part, &rows));
  return 0;
}

/* The values of a part, of rows divided by the scale of their node; to `sums`, where it is not null, the absolute values of
   each row are added. */
static PetscErrorCode blocks_take(const Part *part, PetscInt b, PetscInt n, const double *scale, Blocks *out, double *sums)
{
  Rows rows;
  if (!part->a) return 0;
  PetscCall(rows_open(part, &rows));
  PetscCall(PetscArrayzero(out->value, (size_t)out->start[n] * (size_t)(b * b)));
  for (PetscInt i = 0; i < n; i++) {
    const double factor = 1 / scale[i];
    for (PetscInt r = 0; r < b; r++) {
      PetscInt block = out->start[i];
      for (PetscInt k = rows.start[b * i + r]; k < rows.start[b * i + r + 1]; k++) {
        const PetscInt place = place_of(part, b, i, rows.column[k]);
        const double value = rows.value[k] * factor;
        if (place < 0) continue;
        while (b * (out->node[block] + 1) <= place) block++;
        out->value[(size_t)block * (size_t)(b * b) + (size_t)(b * (place - b * out->node[block]) + r)] = (float)value;
        if (sums) sums[b * i + r] += PetscAbsReal(value);
      }
    }
  }
  PetscCall(rows_close(part, &rows));
  return 0;
}

/* The inverse of a small matrix, column after column, by elimination with the largest pivot of each column. A matrix without
   one gets the inverse of its diagonal, and nothing where that is zero. */
static void invert(PetscInt b, const double *from, double *inverse)
{
  double a[MOST_OF_A_NODE][2 * MOST_OF_A_NODE] = {{0}}, size = 0;
  for (PetscInt c = 0; c < b; c++)
    for (PetscInt r = 0; r < b; r++) {
      a[r][c] = from[c * b + r];
      a[r][b + c] = r == c;
      size = PetscMax(size, PetscAbsReal(a[r][c]));
    }
  for (PetscInt c = 0; c < b; c++) {
    PetscInt pivot = c;
    for (PetscInt r = c + 1; r < b; r++)
      if (PetscAbsReal(a[r][c]) > PetscAbsReal(a[pivot][c])) pivot = r;
    /* entries are of single precision: a smaller pivot is rounding */
    if (!(PetscAbsReal(a[pivot][c]) > 1e-6 * size)) {
      for (PetscInt k = 0; k < b * b; k++) inverse[k] = k % (b + 1) || from[k] == 0 ? 0 : 1 / from[k];
      return;
    }
    for (PetscInt k = 0; k < 2 * b; k++) {
      const double x = a[pivot][k];
      a[pivot][k] = a[c][k];
      a[c][k] = x;
    }
    for (PetscInt r = 0; r < b; r++) {
      const double factor = a[r][c] / a[c][c];
      if (r == c) continue;
      for (PetscInt k = 0; k < 2 * b; k++) a[r][k] -= factor * a[c][k];
    }
  }
  for (PetscInt c = 0; c < b; c++)
    for (PetscInt r = 0; r < b; r++) inverse[c * b + r] = a[r][b + c] / a[r][r];
}

PetscErrorCode sweeps_take(Sweeps *s, Mat a)
{
  PetscInt *places, *ghosts;
  double *sums;
  Part parts[PARTS];
  PetscCall(parts_of(a, s->b, s->n, parts, &places, &ghosts));
  PetscCall(PetscCalloc1(s->b * s->n, &sums));
  PetscCall(PetscArrayzero(s->scale, s->n));
  PetscCall(widen(&parts[BEFORE], s->b, s->n, s->scale)); /* all of its matrix, columns behind included */
  PetscCall(widen(&parts[OTHERS], s->b, s->n, s->scale));
  for (PetscInt i = 0; i < s->n; i++) s->scale[i] = s->scale[i] > 0 ? ldexp(1, ilogb(s->scale[i])) : 1;
  PetscCall(blocks_take(&parts[BEFORE], s->b, s->n, s->scale, &s->before, NULL));
  PetscCall(blocks_take(&parts[BEHIND], s->b, s->n, s->scale, &s->behind, NULL));
  PetscCall(blocks_take(&parts[OTHERS], s->b, s->n, s->scale, &s->others, sums));
  for (PetscInt i = 0; i < s->n; i++) {
    const size_t size = (size_t)(s->b * s->b);
    double diagonal[MOST_OF_A_NODE * MOST_OF_A_NODE], *inverse = s->inverse + size * (size_t)i;
    const float *last = s->before.value + size * (size_t)(s->before.start[i + 1] - 1);
    for (size_t k = 0; k < size; k++) diagonal[k] = last[k];
    for (PetscInt r = 0; r < s->b; r++) {
      double *entry = &diagonal[(s->b + 1) * r];
      *entry += copysign(0.5 * sums[s->b * i + r], *entry);
    }
    invert(s->b, diagonal, inverse);
    for (size_t k = 0; k < size; k++) inverse[k] /= s->scale[i];
  }
  PetscCall(PetscFree(sums));
  PetscCall(PetscFree(places));
  PetscCall(PetscFree(ghosts));
  return 0;
}

PetscErrorCode sweeps_new(Mat a, Sweeps **out)
{
  PetscInt rows, all, *places, *ghosts;
  Part parts[PARTS];
  Sweeps *s;
  PetscCall(PetscNew(&s));
  *out = s;
  PetscCall(MatGetBlockSize(a, &s->b));
  PetscCall(MatGetLocalSize(a, &rows, NULL));
  PetscCall(MatGetSize(a, &all, NULL));
  s->n = rows / s->b;
  s->is_wide = has_wide();
  PetscCall(parts_of(a, s->b, s->n, parts, &places, &ghosts));
  PetscCall(blocks_new(&parts[BEFORE], s->b, s->n, &s->before)); /* every row has an entry on the diagonal */
  PetscCall(blocks_new(&parts[BEHIND], s->b, s->n, &s->behind));
  PetscCall(blocks_new(&parts[OTHERS], s->b, s->n, &s->others));
  PetscCall(PetscMalloc1(s->n, &s->scale));
  PetscCall(PetscMalloc1((size_t)(s->b * s->b) * (size_t)s->n, &s->inverse));
  if (parts[OTHERS].a) {
    IS from;
    Vec x;
    PetscCall(MatCreateVecs(a, &x, NULL));
    PetscCall(ISCreateBlock(PETSC_COMM_SELF, s->b, parts[OTHERS].n_nodes, ghosts, PETSC_COPY_VALUES, &from));
    PetscCall(VecCreateSeq(PETSC_COMM_SELF, s->b * parts[OTHERS].n_nodes, &s->ghosts));
    PetscCall(VecScatterCreate(x, from, s->ghosts, NULL, &s->halo));
    PetscCall(ISDestroy(&from));
    PetscCall(VecDestroy(&x));
  }
  PetscCall(PetscFree(places));
  PetscCall(PetscFree(ghosts));
  PetscCall(MatCreateShell(PETSC_COMM_WORLD, rows, rows, all, all, s, &s->shell));
  PetscCall(sweeps_take(s, a));
  return 0;
}

/* The values of nodes of other ranks; `ghosts` is null where there are none. */
static PetscErrorCode ghosts_open(Sweeps *s, Vec x, const double **ghosts)
{
  *ghosts = NULL;
  if (!s->halo) return 0;
  PetscCall(VecScatterBegin(s->halo, x, s->ghosts, INSERT_VALUES, SCATTER_FORWARD));
  PetscCall(VecScatterEnd(s->halo, x, s->ghosts, INSERT_VALUES, SCATTER_FORWARD));
  PetscCall(VecGetArrayRead(s->ghosts, ghosts));
  return 0;
}

static PetscErrorCode ghosts_close(Sweeps *s, const double **ghosts)
{
  if (s->halo) PetscCall(VecRestoreArrayRead(s->ghosts, ghosts));
  return 0;
}

static PetscErrorCode sweep_forwards(PC pc, Vec rhs, Vec x)
{
  Sweeps *s;
  const double *from;
  double *to;
  PetscCall(PCShellGetContext(pc, &s));
  PetscCall(VecSet(x, 0));
  PetscCall(VecGetArrayRead(rhs, &from));
  PetscCall(VecGetArray(x, &to));
  BY_PROCESSOR(forwards, s, from, to);
  PetscCall(VecRestoreArray(x, &to));
  PetscCall(VecRestoreArrayRead(rhs, &from));
  return 0;
}

/* What PCMG calls with the correction of the coarser levels in x. */
static PetscErrorCode sweep_backwards(PC pc, Vec rhs, Vec x, Vec work, PetscReal rtol, PetscReal abstol, PetscReal dtol,
                                      PetscInt most, PetscBool is_zero, PetscInt *n, PCRichardsonConvergedReason *reason)
{
  Sweeps *s;
  const double *from, *ghosts;
  double *to;
  (void)work;
  (void)rtol;
  (void)abstol;
  (void)dtol;
  (void)most;
  (void)is_zero;
  PetscCall(PCShellGetContext(pc, &s));
  PetscCall(ghosts_open(s, x, &ghosts));
  PetscCall(VecGetArrayRead(rhs, &from));
  PetscCall(VecGetArray(x, &to));
  BY_PROCESSOR(backwards, s, from, ghosts, to);
  PetscCall(VecRestoreArray(x, &to));
  PetscCall(VecRestoreArrayRead(rhs, &from));
  PetscCall(ghosts_close(s, &ghosts));
  *n = 1;
  *reason = PCRICHARDSON_CONVERGED_ITS;
  return 0;
}

static PetscErrorCode left(Mat shell, Vec rhs, Vec x, Vec r)
{
  Sweeps *s;
  const double *b, *at, *ghosts;
  double *to;
  PetscCall(MatShellGetContext(shell, &s));
  PetscCall(ghosts_open(s, x, &ghosts));
  PetscCall(VecGetArrayRead(rhs, &b));
  PetscCall(VecGetArrayRead(x, &at));
  PetscCall(VecGetArrayWrite(r, &to));
  BY_PROCESSOR(residual, s, b, at, ghosts, to);
  PetscCall(VecRestoreArrayWrite(r, &to));
  PetscCall(VecRestoreArrayRead(x, &at));
  PetscCall(VecRestoreArrayRead(rhs, &b));
  PetscCall(ghosts_close(s, &ghosts));
  return 0;
}

/* One sweep in place of what a smoother was. */
static PetscErrorCode becomes(KSP smoother, KSPType type, Sweeps *s, PC *pc)
{
  PetscCall(KSPSetType(smoother, type));
  PetscCall(KSPSetNormType(smoother, KSP_NORM_NONE));
  PetscCall(KSPSetTolerances(smoother, PETSC_DEFAULT, PETSC_DEFAULT, PETSC_DEFAULT, 1));
  PetscCall(KSPSetOperators(smoother, s->shell, s->shell));
  PetscCall(KSPGetPC(smoother, pc));
  PetscCall(PCSetType(*pc, PCSHELL));
  PetscCall(PCShellSetContext(*pc, s));
  return 0;
}

PetscErrorCode sweeps_install(Sweeps *s, PC cycle)
{
  PetscInt levels;
  KSP before, behind;
  PC pc;
  PetscCall(PCMGGetLevels(cycle, &levels));
  if (levels < 2) return 0;
  PetscCall(PCMGGetSmootherUp(cycle, levels - 1, &behind)); /* one of its own from here on */
  PetscCall(PCMGGetSmootherDown(cycle, levels - 1, &before));
  PetscCall(becomes(before, KSPPREONLY, s, &pc));
  PetscCall(PCShellSetApply(pc, sweep_forwards));
  PetscCall(KSPSetInitialGuessNonzero(before, PETSC_FALSE));
  PetscCall(KSPSetUp(before));
  PetscCall(becomes(behind, KSPRICHARDSON, s, &pc));
  PetscCall(PCShellSetApply(pc, sweep_forwards));
  PetscCall(PCShellSetApplyRichardson(pc, sweep_backwards));
  PetscCall(KSPSetInitialGuessNonzero(behind, PETSC_TRUE));
  PetscCall(KSPSetUp(behind));
  PetscCall(PCMGSetResidual(cycle, levels - 1, left, s->shell));
  PetscCall(PCSetOperators(cycle, s->shell, s->shell));
  return 0;
}

void sweeps_free(Sweeps *s)
{
  if (!s) return;
  blocks_free(&s->before);
  blocks_free(&s->behind);
  blocks_free(&s->others);
  PetscFree(s->scale);
  PetscFree(s->inverse);
  VecScatterDestroy(&s->halo);
  VecDestroy(&s->ghosts);
  MatDestroy(&s->shell);
  PetscFree(s);
}
