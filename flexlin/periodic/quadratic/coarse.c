/* About the periodic solution of Riccati's equation on few nodes: segments of the Hamiltonian in scattering form, however fast it is, over four
 * parts of a period at once, and closed by Newton's method. Before correction.c; conventions as in sweeps.c.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define MOST_DOUBLINGS 30
#define BEGIN 0.25   /* size of a step times the rate, whose exponential few powers give */
#define STARTS 200
#define UNSEEN 1e7      /* growth of a mode after which a cost that does not hold it hardly sees it */
#define SETTLED 1e-4 /* change of X's ends after which it is swept once more */

/* R with H = R' R, R upper triangular, of a positive semidefinite H (n, n): a pivot that is rounding leaves an empty row. */
static void take_root(int n, const v4 *H, v4 *R) {
  memset(R, 0, n * n * sizeof(v4));
  for (int i = 0; i < n; i++) {
    v4 size = H[i * n + i], pivot = size, scale;
    for (int k = 0; k < i; k++) pivot -= R[k * n + i] * R[k * n + i];
    for (int l = 0; l < 4; l++) scale[l] = pivot[l] > 1e-15 * size[l] && pivot[l] > 0.0 ? 1.0 / sqrt(pivot[l]) : 0.0;
    for (int j = i; j < n; j++) {
      v4 sum = H[i * n + j];
      for (int k = 0; k < i; k++) sum -= R[k * n + i] * R[k * n + j];
      R[i * n + j] = sum * scale;
    }
  }
}

/* U with U' U = H (1 + G H)^-1, H and G positive semidefinite. */
static void hold_back(int n, const v4 *G, const v4 *H, v4 *U) {
  int z = n * n;
  v4 by[z], K[z], turned[z], L[z];
  take_root(n, H, U);
  for (int i = 0; i < n; i++)
    for (int j = 0; j < n; j++) turned[j * n + i] = U[i * n + j];
  multiply(n, U, G, by);
  multiply(n, by, turned, K);
  for (int i = 0; i < n; i++) K[i * n + i] += 1.0;
  take_root(n, K, L);
  for (int i = 0; i < n; i++) /* L'^-1 U */
    for (int j = 0; j < n; j++) {
      v4 sum = U[i * n + j];
      for (int k = 0; k < i; k++) sum -= L[k * n + i] * U[k * n + j];
      U[i * n + j] = sum / L[i * n + i];
    }
}

/* A^-1 in place of a matrix near 1. */
static void invert(int n, v4 *A) {
  for (int k = 0; k < n; k++) {
    v4 pivot = 1.0 / A[k * n + k];
    A[k * n + k] = splat(1.0);
    for (int j = 0; j < n; j++) A[k * n + j] *= pivot;
    for (int i = 0; i < n; i++) {
      if (i == k) continue;
      v4 factor = A[i * n + k];
      A[i * n + k] = splat(0.0);
      for (int j = 0; j < n; j++) A[i * n + j] -= factor * A[k * n + j];
    }
  }
}

/* The segment F, G, H (n, n) of a constant Hamiltonian over h in scattering form, by doubling. */
static void scatter(int n, double h, int doublings, const v4 *A, const v4 *S, const v4 *Q, v4 *F, v4 *G, v4 *H) {
  int z = n * n;
  int m = 2 * n;
  v4 U[z], Y[z], V[z], P[z], W[z], all[m * m], step[m * m];
  for (int i = 0; i < n; i++)
    for (int j = 0; j < n; j++) {
      all[i * m + j] = A[i * n + j], all[i * m + n + j] = -S[i * n + j];
      all[(n + i) * m + j] = -Q[i * n + j], all[(n + i) * m + n + j] = -A[j * n + i];
    }
  carry(m, ldexp(h, -doublings), all, 0, step);
  for (int i = 0; i < n; i++)
    for (int j = 0; j < n; j++) {
      U[i * n + j] = step[(n + i) * m + n + j];
      V[i * n + j] = -step[i * m + n + j], P[i * n + j] = -step[(n + i) * m + j];
    }
  invert(n, U);
  multiply(n, V, U, W);
  multiply(n, U, P, Y);
  for (int i = 0; i < n; i++)
    for (int j = 0; j < n; j++) {
      F[i * n + j] = U[j * n + i];
      G[i * n + j] = 0.5 * (W[i * n + j] + W[j * n + i]), H[i * n + j] = 0.5 * (Y[i * n + j] + Y[j * n + i]);
    }
  for (int k = 0; k < doublings; k++) {
    hold_back(n, G, H, U);
    multiply(n, U, F, Y);
    multiply(n, U, G, V);
    multiply_turned(n, Y, Y, P);
    for (int i = 0; i < z; i++) H[i] += P[i];
    multiply_turned(n, V, V, P);
    for (int i = 0; i < z; i++) P[i] = G[i] - P[i];
    multiply(n, F, P, W);
    for (int i = 0; i < n; i++)
      for (int j = 0; j < n; j++) P[j * n + i] = F[i * n + j];
    multiply(n, W, P, U);
    for (int i = 0; i < n; i++)
      for (int j = 0; j < n; j++) G[i * n + j] += 0.5 * (U[i * n + j] + U[j * n + i]);
    multiply_turned(n, V, Y, P);
    for (int i = 0; i < z; i++) P[i] = F[i] - P[i];
    multiply(n, F, P, W);
    memcpy(F, W, z * sizeof(v4));
  }
}

/* A, B R^-1 B' and Q (n, n) at a node. */
static void spread(const Equation *is, long j, v4 *A, v4 *S, v4 *Q) {
  int n = is->n, some = is->last - is->first;
  const v4 *given = is->S.at + j * is->S.step;
  memcpy(A, is->A.at + j * is->A.step, n * n * sizeof(v4));
  unfold(n, is->Q.at + j * is->Q.step, Q);
  memset(S, 0, n * n * sizeof(v4));
  for (int i = 0; i < some; i++)
    for (int k = 0; k < some; k++) S[(is->first + i) * n + is->first + k] = -2.0 * given[i * some + k];
}

/* About X (nodes, E) at every second node of each part, by segments of the Hamiltonian half-way; false where it does not settle. */
static int begin_coarsely(const Equation *is, double h, double rate, v4 *X) {
  int n = is->n, z = n * n, E = triangle(n), doublings = 0;
  long nodes = is->nodes / 2;
  while (ldexp(h * rate, -doublings) > BEGIN && doublings < MOST_DOUBLINGS) doublings++;
  v4 *segments = malloc(3 * nodes * z * sizeof(v4)), A[z], S[z], Q[z], U[z], Y[z], cost[z], end[z], gap[z], Phi[z];
  int done = 0;
  if (!segments) return 0;
  for (long j = 0; j < nodes; j++) {
    v4 *at = segments + 3 * j * z;
    spread(is, 2 * j + 1, A, S, Q);
    scatter(n, h, doublings, A, S, Q, at, at + z, at + 2 * z);
  }
  double grown = 1.0;
  memset(end, 0, sizeof end);
  for (int k = 0; k < STARTS && done < 2; k++) {
    memcpy(cost, end, sizeof cost);
    memset(Phi, 0, sizeof Phi);
    for (int i = 0; i < n; i++) Phi[i * n + i] = splat(1.0);
    for (long j = nodes - 1; j >= 0; j--) {
      const v4 *F = segments + 3 * j * z, *G = F + z, *H = G + z;
      hold_back(n, G, cost, U);
      multiply(n, U, F, Y);
      multiply_turned(n, Y, Y, cost);
      for (int i = 0, e = 0; i < n; i++)
        for (int l = 0; l < n; l++) {
          cost[i * n + l] += H[i * n + l];
          if (l <= i) X[j * E + e++] = cost[i * n + l];
        }
      multiply_turned(n, U, Y, S);
      multiply(n, G, S, Q);
      for (int i = 0; i < z; i++) Q[i] = F[i] - Q[i];
      multiply(n, Phi, Q, A);
      memcpy(Phi, A, sizeof Phi);
    }
    if (done || !isfinite(largest(z, cost))) break;
    for (int i = 0; i < z; i++) gap[i] = turn(cost[i], 1) - end[i];
    double size = largest(z, Phi);
    if (k >= PARTS && close_parts(n, gap, Phi, A)) done = compare(n, A, X) <= SETTLED;
    else {
      memcpy(A, gap, sizeof A);
      if (k >= PARTS && (grown *= fmax(size, 1.0)) > UNSEEN) break;
    }
    for (int i = 0; i < z; i++) end[i] += A[i];
  }
  free(segments);
  return done;
}
