/* Mean and spread of the images of sigma points. Y ((2 M + 1) x N) holds of each of N numbers the
   image of the centre, then of M points ahead and of the M opposite ones, all at distance H[0].
   ROWS (N x (2 M + 1)): half differences over H, half sums less the centre over H, and what the
   centre's weight adds; ROWS ROWS^T is the covariance, MEAN (N) the mean. */
const casadi_real half = 0.5 / H[0], share = H[0] * H[0] / M;
const casadi_real left = sqrt(share < 1 ? 2 - share : 1);
casadi_int i, k;
for (i = 0; i < N; ++i) {
  const casadi_real *ahead = Y + (2 * M + 1) * i + 1, *behind = ahead + M, centre = ahead[-1];
  casadi_real sum = 0;
  for (k = 0; k < M; ++k) {
    const casadi_real bend = half * (ahead[k] + behind[k] - 2 * centre);
    ROWS[N * k + i] = half * (ahead[k] - behind[k]);
    ROWS[N * (M + k) + i] = bend;
    sum += bend;
  }
  MEAN[i] = centre + sum / H[0];
  ROWS[N * 2 * M + i] = left * sum / H[0];
}
