//! The simplex search of Nelder & Mead (1965), restarted until it gains nothing.

/// The maximum of `f` near `start`, with a first simplex of these `sizes`. `f` may be −∞.
pub(super) fn maximize(f: impl Fn(&[f64]) -> f64, start: &[f64], sizes: &[f64]) -> (Vec<f64>, f64) {
    let mut best = (start.to_vec(), f(start));
    for restart in 0..8 {
        let scale = 0.5f64.powi(restart);
        let sizes: Vec<f64> = sizes.iter().map(|s| s * scale).collect();
        let found = once(&f, &best.0, &sizes);
        let gain = found.1 - best.1;
        if found.1 > best.1 {
            best = found;
        }
        if restart > 1 && gain < 1e-10 {
            break;
        }
    }
    best
}

fn once(f: &impl Fn(&[f64]) -> f64, start: &[f64], sizes: &[f64]) -> (Vec<f64>, f64) {
    let n = start.len();
    let mut points: Vec<(Vec<f64>, f64)> = vec![(start.to_vec(), f(start))];
    for (i, size) in sizes.iter().enumerate() {
        let mut corner = start.to_vec();
        corner[i] += size;
        let value = f(&corner);
        points.push((corner, value));
    }
    for _ in 0..400 * n {
        points.sort_by(|a, b| b.1.total_cmp(&a.1));
        let (best, worst) = (points[0].1, points[n].1);
        let spread = (0..n).all(|i| {
            let far = points.iter().map(|p| (p.0[i] - points[0].0[i]).abs());
            far.fold(0.0, f64::max) < 1e-9
        });
        if spread || best - worst < 1e-13 * best.abs() {
            break;
        }
        let middle: Vec<f64> = (0..n)
            .map(|i| points[..n].iter().map(|p| p.0[i]).sum::<f64>() / n as f64)
            .collect();
        // The point at `t` times the way from the middle to the worst.
        let along = |t: f64| {
            let at: Vec<f64> = (middle.iter().zip(&points[n].0))
                .map(|(m, w)| m + t * (w - m))
                .collect();
            let value = f(&at);
            (at, value)
        };
        let reflected = along(-1.0);
        points[n] = if reflected.1 > best {
            let expanded = along(-2.0);
            if expanded.1 > reflected.1 {
                expanded
            } else {
                reflected
            }
        } else if reflected.1 > points[n - 1].1 {
            reflected
        } else {
            let inside = along(if reflected.1 > worst { -0.5 } else { 0.5 });
            if inside.1 <= worst.max(reflected.1) {
                let first = points[0].0.clone();
                for point in &mut points[1..] {
                    for (x, b) in point.0.iter_mut().zip(&first) {
                        *x = 0.5 * (*x + b);
                    }
                    point.1 = f(&point.0);
                }
                continue;
            }
            inside
        };
    }
    points.sort_by(|a, b| b.1.total_cmp(&a.1));
    points.swap_remove(0)
}
