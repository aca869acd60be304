/* The loops of sweeps.c, which includes this for each kind of processor: FOR names its instructions, NAME its
   functions, and AS_DOUBLES makes four doubles of four floats. */

/* sum += value * x for the blocks from `first` to `end`. A load of four floats takes one of the next column, or of what
   stands behind the last block, with it: its sum is not used. */
#undef ADD_COLUMN
#define ADD_COLUMN(sum, from, factor) \
  do { \
    Floats column_; \
    __builtin_memcpy(&column_, (from), sizeof column_); \
    (sum) += AS_DOUBLES(column_) * (factor); \
  } while (0)

/* The blocks of node i: to later ones (step 1) or to earlier ones (step -1). */
INLINE FOR void NAME(add_blocks)(const int b, const Blocks *a, PetscInt i, const int step, const double *x, double *sum)
{
  const PetscInt first = step > 0 ? a->start[i] : a->start[i + 1] - 1;
  const PetscInt *node = a->node + first;
  const float *value = a->value + (size_t)(b * b) * (size_t)first;
  PetscInt count = a->start[i + 1] - a->start[i];
  if (b == 3) {
    Doubles s0 = {0}, s1 = {0}, s2 = {0};
    for (; count > 0; count--, node += step, value += 9 * step) {
      const double *at = x + 3 * (size_t)*node;
      ADD_COLUMN(s0, value, at[0]);
      ADD_COLUMN(s1, value + 3, at[1]);
      ADD_COLUMN(s2, value + 6, at[2]);
    }
    s0 = (s0 + s1) + s2;
    for (int r = 0; r < 3; r++) sum[r] += s0[r];
    return;
  }
  for (; count > 0; count--, node += step, value += b * b * step) {
    const double *at = x + (size_t)b * (size_t)*node;
    for (int c = 0; c < b; c++)
      for (int r = 0; r < b; r++) sum[r] += (double)value[c * b + r] * at[c];
  }
}

/* left = rhs - scale * sum, at node i */
INLINE FOR void NAME(subtract)(const int b, const Sweeps *s, PetscInt i, const double *rhs, const double *sum, double *left)
{
  for (int r = 0; r < b; r++) left[r] = rhs[b * i + r] - s->scale[i] * sum[r];
}

/* x_i += D_i^-1 left */
INLINE FOR void NAME(correct)(const int b, const Sweeps *s, PetscInt i, const double *left, double *x)
{
  const double *inverse = s->inverse + b * b * (size_t)i;
  double change[MOST_OF_A_NODE];
  for (int r = 0; r < b; r++) change[r] = inverse[r] * left[0];
  for (int c = 1; c < b; c++)
    for (int r = 0; r < b; r++) change[r] += inverse[c * b + r] * left[c];
  for (int r = 0; r < b; r++) x[b * i + r] += change[r];
}

/* From x = 0: what follows in the order is zero still, and so are the ghosts. */
INLINE FOR void NAME(forwards_of)(const int b, const Sweeps *s, const double *rhs, double *x)
{
  for (PetscInt i = 0; i < s->n; i++) {
    double sum[MOST_OF_A_NODE] = {0}, left[MOST_OF_A_NODE];
    NAME(add_blocks)(b, &s->before, i, 1, x, sum);
    NAME(subtract)(b, s, i, rhs, sum, left);
    NAME(correct)(b, s, i, left, x);
  }
}

/* All is read backwards. The node that was just left comes last: the processor has begun with the others when its values
   arrive. */
INLINE FOR void NAME(backwards_of)(const int b, const Sweeps *s, const double *rhs, const double *ghosts, double *x)
{
  for (PetscInt i = s->n - 1; i >= 0; i--) {
    double sum[MOST_OF_A_NODE] = {0}, left[MOST_OF_A_NODE];
    if (ghosts) NAME(add_blocks)(b, &s->others, i, -1, ghosts, sum);
    NAME(add_blocks)(b, &s->before, i, -1, x, sum);
    NAME(add_blocks)(b, &s->behind, i, -1, x, sum);
    NAME(subtract)(b, s, i, rhs, sum, left);
    NAME(correct)(b, s, i, left, x);
  }
}

INLINE FOR void NAME(residual_of)(const int b, const Sweeps *s, const double *rhs, const double *x, const double *ghosts,
                                  double *r)
{
  for (PetscInt i = 0; i < s->n; i++) {
    double sum[MOST_OF_A_NODE] = {0};
    NAME(add_blocks)(b, &s->before, i, 1, x, sum);
    NAME(add_blocks)(b, &s->behind, i, 1, x, sum);
    if (ghosts) NAME(add_blocks)(b, &s->others, i, 1, ghosts, sum);
    NAME(subtract)(b, s, i, rhs, sum, r + b * i);
  }
}

/* The loops for each number of rows of a node: it is known to them. */
FOR static void NAME(forwards)(const Sweeps *s, const double *rhs, double *x)
{
  if (s->b == 3) NAME(forwards_of)(3, s, rhs, x);
  else if (s->b == 2) NAME(forwards_of)(2, s, rhs, x);
  else NAME(forwards_of)(1, s, rhs, x);
}

FOR static void NAME(backwards)(const Sweeps *s, const double *rhs, const double *ghosts, double *x)
{
  if (s->b == 3) NAME(backwards_of)(3, s, rhs, ghosts, x);
  else if (s->b == 2) NAME(backwards_of)(2, s, rhs, ghosts, x);
  else NAME(backwards_of)(1, s, rhs, ghosts, x);
}

FOR static void NAME(residual)(const Sweeps *s, const double *rhs, const double *x, const double *ghosts, double *r)
{
  if (s->b == 3) NAME(residual_of)(3, s, rhs, x, ghosts, r);
  else if (s->b == 2) NAME(residual_of)(2, s, rhs, x, ghosts, r);
  else NAME(residual_of)(1, s, rhs, x, ghosts, r);
}

