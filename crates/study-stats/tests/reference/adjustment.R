# Reference values of the tests in crates/study-stats/src/adjustment.rs, from base R: Rscript adjustment.R.
# Six subjects, of each the settings that started below and above.
options(digits = 15)
up <- list(c(.9, 1, 1.1), c(1.2, 1.1, 1), c(.8, .9, .9), c(1.3, 1.1), c(1, 1.2, 1.1), 1.4)
down <- list(c(1.2, 1.1, 1.3), c(1.2, 1.4, 1.3), c(1, 1, .9), c(1.3, 1.5, 1.2), c(1.1, 1, 1.3), 1.5)
show <- function(name, x) cat(name, format(x, digits = 15), "\n")

pse <- (sapply(up, mean) + sapply(down, mean)) / 2
show("pse", pse)
show("mean, interval", c(mean(pse), t.test(pse)$conf.int))
error <- t.test(pse, mu = 1)
show("against 1: t, p", c(error$statistic, error$p.value))
difference <- t.test(sapply(up, mean) - sapply(down, mean))
show("difference: mean, t, p", c(difference$estimate, difference$statistic, difference$p.value))

squares <- function(x) sum((x - mean(x))^2)
ss <- mapply(function(a, b) squares(a) + squares(b), up, down)
df <- mapply(function(a, b) length(a) - 1 + length(b) - 1, up, down)
show("sd of the first", sqrt(ss[1] / df[1]))
show("spread, df", c(sqrt(sum(ss) / sum(df)), sum(df)))
known <- which(df > 0)
all <- as.matrix(expand.grid(rep(list(known), length(known))))
spreads <- apply(all, 1, function(i) sqrt(sum(ss[i]) / sum(df[i])))
show("quantiles of all resamples", quantile(spreads, c(.015, .035, .965, .985)))
