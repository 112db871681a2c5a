# Reference values of crates/study-stats/src/identification/tests.rs, from base R: Rscript identification.R.
# With a reference file it compares the numbers of identification.py, too (jsonlite):
# Rscript identification.R ../../../../tests/golden/psychophysics/identification_sim.json
# Rows of a matrix are the labels that were right, columns those that were given.
options(digits = 17)

matrices <- list(
  P1 = rbind(c(8, 2, 0, 0), c(1, 7, 2, 0), c(0, 3, 6, 1), c(0, 0, 2, 8)),
  P2 = rbind(c(6, 3, 1, 0), c(2, 6, 1, 1), c(1, 2, 6, 1), c(0, 1, 3, 6)),
  P3 = rbind(c(10, 0, 0, 0), c(0, 9, 1, 0), c(0, 4, 5, 1), c(0, 0, 0, 10)))

entropy <- function(counts) { p <- counts[counts > 0] / sum(counts); -sum(p * log2(p)) }
information <- function(m) {
  transmitted <- entropy(rowSums(m)) + entropy(colSums(m)) - entropy(m)
  expected <- outer(rowSums(m), colSums(m))
  # Cells − rows − columns + the sum of n²/(r c): Miller's bias for fixed numbers of presentations.
  cells <- sum(m > 0) - sum(rowSums(m) > 0) - sum(colSums(m) > 0) + sum((m^2 / expected)[m > 0])
  c(transmitted = transmitted, corrected = transmitted - cells / (2 * sum(m) * log(2)),
    stimulus = entropy(rowSums(m)), response = entropy(colSums(m)))
}
# The interval of the corrected information, on the logarithm of what is lost.
lost <- function(m) information(m)[["stimulus"]] - information(m)[["corrected"]]
transfer_interval <- function(all) {
  total <- information(Reduce(`+`, all))
  least <- min(total[["stimulus"]] - total[["corrected"]], total[["stimulus"]])
  half <- qt(0.975, length(all) - 1) * jackknife(all, lost) / least
  pmax(total[["stimulus"]] - least * exp(c(half, -half)), 0)
}

# Luce's model is quasi-symmetry: a log-linear model of rows and of pairs of cells.
choice <- function(m) {
  k <- nrow(m)
  m <- m + 1 / k
  row <- factor(as.vector(row(m)))
  pair <- factor(paste(pmin(row(m), col(m)), pmax(row(m), col(m))))
  fit <- suppressWarnings(glm(as.vector(m) ~ row + pair, family = poisson(),
                              control = list(epsilon = 1e-14, maxit = 100)))
  fitted <- matrix(fitted(fit), k, k)
  similarity <- sqrt(fitted * t(fitted) / outer(diag(fitted), diag(fitted)))
  weight <- sqrt(fitted[1, ] * diag(fitted) / (fitted[, 1] * fitted[1, 1]))
  list(similarity = similarity, bias = weight / sum(weight))
}

sensitivity <- function(m, a, b) {
  rate <- function(k, n) (k + 0.5) / (n + 1)
  qnorm(rate(m[a, a], m[a, a] + m[a, b])) - qnorm(rate(m[b, a], m[b, a] + m[b, b]))
}

jackknife <- function(all, statistic) {
  n <- length(all)
  left <- sapply(seq_len(n), function(i) statistic(Reduce(`+`, all[-i])))
  sqrt((n - 1) / n * sum((left - mean(left))^2))
}

above_guessing <- function(all) {
  above <- sapply(all, function(m) sum(diag(m)) / sum(m) - sum(rowSums(m) * colSums(m)) / sum(m)^2)
  variance <- sapply(all, function(m) {
    n <- sum(m)
    product <- rowSums(m) * colSums(m)
    alone <- sum(product * (n - rowSums(m)) * (n - colSums(m)))
    (alone + sum(product)^2 - sum(product^2)) / (n^2 * (n - 1)) / n^2
  })
  n <- length(above)
  se <- sqrt(max(var(above) / n, 0.25 * sum(variance) / n^2))
  t <- mean(above) / se
  c(mean = mean(above), se = se, t = t, p = 2 * pt(-abs(t), n - 1))
}

pooled <- Reduce(`+`, matrices)
print(information(pooled))
print(jackknife(matrices, lost))
print(transfer_interval(matrices))
print(choice(pooled))
pairs <- combn(4, 2)
for (i in seq_len(ncol(pairs))) {
  a <- pairs[1, i]
  b <- pairs[2, i]
  cat(a, b, "similarity", choice(pooled)$similarity[a, b],
      jackknife(matrices, function(m) log(choice(m)$similarity[a, b])),
      "d", sensitivity(pooled, a, b), jackknife(matrices, function(m) sensitivity(m, a, b)), "\n")
}
print(above_guessing(matrices))

# Everybody is right: the error is that of guesses.
perfect <- lapply(1:5, function(i) diag(6, 3))
print(above_guessing(perfect))

# Near perfect answers of three participants, one of whom makes two errors.
rare <- list(diag(10, 3), diag(10, 3), rbind(c(9, 1, 0), c(0, 10, 0), c(1, 0, 9)))
print(information(Reduce(`+`, rare)))
print(transfer_interval(rare))
# Three participants near chance: less than nothing is transmitted.
chance <- list(rbind(c(5, 5), c(5, 5)), rbind(c(6, 4), c(4, 6)), rbind(c(4, 6), c(5, 5)))
print(information(Reduce(`+`, chance)))
print(transfer_interval(chance))

file <- commandArgs(TRUE)
if (length(file) == 1) {
  golden <- jsonlite::fromJSON(file)
  rows <- as.data.frame(golden$input$rows)
  names(rows) <- golden$input$columns
  labels <- golden$input$labels
  own <- lapply(split(rows, rows$participant), function(of) {
    unclass(table(factor(of$target, labels), factor(of$answer, labels)))
  })
  total <- Reduce(`+`, own)
  compared <- 0
  compare <- function(id, value) {
    want <- golden$expected[[paste0("identification/", id)]]
    stopifnot(abs(value - want$value) <= want$tol_rel * abs(want$value) + want$tol_abs)
    compared <<- compared + 1
  }
  ends <- function(id, estimate, se, shown = identity) {
    half <- qt(0.975, length(own) - 1) * se
    compare(paste0(id, "_lo"), shown(estimate - half))
    compare(paste0(id, "_hi"), shown(estimate + half))
  }
  escaped <- function(name) gsub("/", "%2F", name, fixed = TRUE)
  bits <- information(total)
  compare("correct", sum(diag(total)) / sum(total))
  for (what in c("transmitted", "corrected", "stimulus")) compare(paste0("information/", what), bits[[what]])
  interval <- transfer_interval(own)
  for (end in 1:2) {
    side <- c("_lo", "_hi")[end]
    compare(paste0("information/corrected_ci95", side), interval[end])
    compare(paste0("information/items_ci95", side), 2^interval[end])
  }
  above <- above_guessing(own)
  for (what in names(above)) compare(paste0("above_guessing/", what), above[[what]])
  for (a in seq_along(labels)) {
    compare(paste0("label/", escaped(labels[a]), "/bias"), choice(total)$bias[a])
    for (b in seq_along(labels)) {
      compare(paste0("confusion/", escaped(labels[a]), "/", escaped(labels[b])), total[a, b])
      if (a < b) {
        pair <- paste0("pair/", escaped(labels[a]), "|", escaped(labels[b]), "/")
        similarity <- choice(total)$similarity[a, b]
        compare(paste0(pair, "similarity"), similarity)
        ends(paste0(pair, "similarity_ci95"), log(similarity),
             jackknife(own, function(m) log(choice(m)$similarity[a, b])), exp)
        compare(paste0(pair, "d"), sensitivity(total, a, b))
        ends(paste0(pair, "d_ci95"), sensitivity(total, a, b), jackknife(own, function(m) sensitivity(m, a, b)))
      }
    }
  }
  for (who in names(own)) {
    compare(paste0("participant/", who, "/information"), information(own[[who]])[["corrected"]])
  }
  cat(compared, "numbers agree\n")
}
