# An independent simulation of designs of docs/power.md: exact permutation test of Pearson's r over
# six evenly spaced realizations, rejecting at p <= .05. Prints the share of 20,000 studies.
#
#   Rscript lab/power-check.R
set.seed(11)
orders <- function(x) {
  if (length(x) < 2) return(list(x))
  do.call(c, lapply(seq_along(x), function(i) lapply(orders(x[-i]), function(o) c(x[i], o))))
}
share <- function(n, q, r, slope, realization, own = 0, mean = 4, rounded = FALSE, studies = 20000) {
  x <- seq_len(q)
  x <- (x - mean(x)) / sqrt(mean((x - mean(x))^2))
  shuffled <- matrix(x[do.call(rbind, orders(seq_len(q)))], ncol = q)
  noise <- function(columns, sd) matrix(rnorm(studies * columns, sd = sd), studies)
  scatter <- noise(q, realization)
  means <- matrix(0, studies, q)
  for (i in seq_len(n)) {
    true <- mean + as.vector(noise(1, 0.6)) + outer(as.vector(noise(1, own)) + slope, x) + scatter + noise(q, 0.4)
    for (k in seq_len(r)) {
      rating <- true + noise(q, 0.8)
      if (rounded) rating <- pmin(7, pmax(1, ceiling(rating - 0.5)))
      means <- means + rating / (n * r)
    }
  }
  means <- means - rowMeans(means)
  size <- sqrt(sum(x^2) * rowSums(means^2))
  p <- rowMeans(abs(means %*% t(shuffled)) >= as.vector(abs(means %*% x)) - 1e-10 * size)
  mean(p <= 0.05 & size > 1e-6)
}
cat(sprintf("14 x 6 x 2, slope .5, realizations .5: %.3f\n", share(14, 6, 2, 0.5, 0.5)))
cat(sprintf("8 x 6 x 4, no effect, realizations .3, slopes .3: %.3f\n", share(8, 6, 4, 0, 0.3, 0.3)))
cat(sprintf("9 x 6 x 1, slope .5, realizations .3, mean 6.2, rounded: %.3f\n", share(9, 6, 1, 0.5, 0.3, 0, 6.2, TRUE)))
cat(sprintf("10 x 6 x 3, no effect, realizations .5: %.3f\n", share(10, 6, 3, 0, 0.5)))
