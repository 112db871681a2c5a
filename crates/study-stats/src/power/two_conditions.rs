//! Two conditions: the five designs of Westfall, Kenny and Judd.
//!
//! Power when both subjects and realizations are random. The condition is coded ±1, so
//! that the slopes have the variances PC (subjects) and SC (realizations). Degrees of
//! freedom are Satterthwaite's at the true variances: both overstate the power with fewer
//! than about eight subjects or realizations.
//!
//! Sources: Westfall, Kenny & Judd (2014), J. Exp. Psychol. Gen. 143, 2020–2045. Their
//! published program has half of each slope component in its mean squares, but the whole
//! in its noncentrality; the mean squares here follow from the model, and 40 000 simulated
//! analyses of variance of each design agree with them.

use super::power;

/// Who and what sees which condition.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Design {
    /// Every subject rates every realization in both conditions.
    Crossed,
    /// Every subject rates each realization in one condition, which half of the subjects
    /// have the other way round.
    Counterbalanced,
    /// Each realization belongs to one condition.
    RealizationsWithin,
    /// Each subject belongs to one condition.
    SubjectsWithin,
    /// Each subject and each realization belongs to one condition.
    BothWithin,
}

/// Variance components.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Variances {
    /// E: residual.
    pub residual: f64,
    /// S: levels of the realizations.
    pub realization: f64,
    /// P: levels of the subjects.
    pub subject: f64,
    /// PS: subject × realization.
    pub interaction: f64,
    /// SC: effect of the condition by realization.
    pub realization_slope: f64,
    /// PC: effect of the condition by subject.
    pub subject_slope: f64,
}

/// Power of the test of the condition.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Expected {
    /// Noncentrality.
    pub ncp: f64,
    /// Satterthwaite's degrees of freedom.
    pub df: f64,
    /// Probability of rejection.
    pub power: f64,
    /// Degrees of freedom of the authors' published program.
    pub df_published: f64,
    /// Power with these.
    pub power_published: f64,
}

/// Power at the two-sided level `alpha` for a difference of the condition means of `d`
/// times the root of all variances, with so many subjects and realizations in all. `None`
/// if degrees of freedom or variances are not positive.
pub fn expected(
    design: Design,
    d: f64,
    variances: &Variances,
    subjects: usize,
    realizations: usize,
    alpha: f64,
) -> Option<Expected> {
    let v = variances;
    let (p, q) = (subjects as f64, realizations as f64);
    let total = v.residual
        + v.realization
        + v.subject
        + v.interaction
        + v.realization_slope
        + v.subject_slope;
    let subjects_within = matches!(design, Design::SubjectsWithin | Design::BothWithin);
    let realizations_within = matches!(design, Design::RealizationsWithin | Design::BothWithin);
    // What belongs to one condition has its level in the comparison.
    let with_level =
        |within: bool, slope: f64, level: f64| slope + if within { level } else { 0.0 };
    let by_subject = with_level(subjects_within, v.subject_slope, v.subject);
    let by_realization = with_level(realizations_within, v.realization_slope, v.realization);
    // Error, its weight in the variance of the difference, the weight of a slope in a mean
    // square, and the degrees of freedom lost.
    let (e, weight, share, lost) = match design {
        Design::Crossed => (v.residual, 2.0, 2.0, (1.0, 1.0)),
        Design::Counterbalanced => (v.residual + v.interaction, 4.0, 1.0, (2.0, 2.0)),
        Design::RealizationsWithin => (v.residual + v.interaction, 4.0, 1.0, (1.0, 2.0)),
        Design::SubjectsWithin => (v.residual + v.interaction, 4.0, 1.0, (2.0, 1.0)),
        Design::BothWithin => (v.residual + v.interaction, 8.0, 0.5, (2.0, 2.0)),
    };
    let variance = 4.0 * by_subject / p + 4.0 * by_realization / q + weight * e / (p * q);
    let (f_p, f_s) = (p - lost.0, q - lost.1);
    if !(f_p > 0.0 && f_s > 0.0 && variance > 0.0) {
        return None;
    }
    let ncp = d * total.sqrt() / variance.sqrt();
    let df = |of_subjects: f64, of_realizations: f64| {
        let (m_p, m_s) = (
            e + q * of_subjects * by_subject,
            e + p * of_realizations * by_realization,
        );
        (m_p + m_s - e).powi(2) / (m_p * m_p / f_p + m_s * m_s / f_s + e * e / (f_p * f_s))
    };
    // The program halves the slope of whoever sees both conditions.
    let halved = |within: bool| if within { share } else { share / 2.0 };
    let own = df(share, share);
    let published = df(halved(subjects_within), halved(realizations_within));
    Some(Expected {
        ncp,
        df: own,
        power: power(ncp, own, alpha)?,
        df_published: published,
        power_published: power(ncp, published, alpha)?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The noncentral t of SciPy 1.17 and R 4.2.2 at these formulas, which agree to
    /// 3·10⁻¹²; the last two numbers are the authors' published program.
    #[test]
    fn the_five_designs_agree_with_two_programs() {
        use Design::{BothWithin, Counterbalanced, Crossed, RealizationsWithin, SubjectsWithin};
        let even = Variances {
            residual: 0.3,
            realization: 0.2,
            subject: 0.2,
            interaction: 0.1,
            realization_slope: 0.1,
            subject_slope: 0.1,
        };
        type Case = (Design, f64, usize, usize, [f64; 5]);
        let cases: [Case; 6] = [
            (Crossed, 0.5, 20, 20, CROSSED),
            (Counterbalanced, 0.5, 20, 20, COUNTERBALANCED),
            (RealizationsWithin, 0.8, 16, 8, REALIZATIONS),
            (SubjectsWithin, 0.8, 16, 8, SUBJECTS),
            (SubjectsWithin, 0.5, 30, 10, SUBJECTS_MANY),
            (BothWithin, 0.5, 30, 10, BOTH),
        ];
        for (design, d, p, q, numbers) in cases {
            let found = expected(design, d, &even, p, q, 0.05).unwrap();
            let of = [
                found.ncp,
                found.df,
                found.power,
                found.df_published,
                found.power_published,
            ];
            for (found, expected) in of.into_iter().zip(numbers) {
                let close = (found - expected).abs() < 1e-8 * expected.abs().max(1.0);
                assert!(close, "{design:?}: {found}, {expected}");
            }
        }
        assert_eq!(expected(BothWithin, 0.5, &even, 2, 10, 0.05), None);
    }

    const CROSSED: [f64; 5] = [
        2.454_403_468_369_079_6,
        35.390_545_175_107_79,
        0.665_471_354_367_309_6,
        33.190_244_144_995_28,
        0.663_843_317_433_579_9,
    ];
    const COUNTERBALANCED: [f64; 5] = [
        2.383_656_473_113_980_7,
        30.226_676_946_800_3,
        0.635_893_999_768_727_1,
        26.389_140_271_493_215,
        0.631_700_651_217_895_6,
    ];
    const REALIZATIONS: [f64; 5] = [
        1.847_520_861_406_802_4,
        7.818_532_818_532_818,
        0.368_044_037_687_784_93,
        6.890_625,
        0.357_026_478_726_725_2,
    ];
    const SUBJECTS: [f64; 5] = [
        2.157_439_559_882_375,
        17.086_455_331_412_104,
        0.530_143_617_518_478_9,
        16.889_361_702_127_655,
        0.529_576_726_096_766_6,
    ];
    const SUBJECTS_MANY: [f64; 5] = [
        1.711_632_992_203_643_7,
        24.123_399_083_855_293,
        0.376_007_867_829_407_37,
        29.474_473_889_321_906,
        0.380_689_637_397_544_8,
    ];
    const BOTH: [f64; 5] = [
        1.210_307_295_689_817_8,
        13.082_530_086_123_308,
        0.202_285_033_063_261_93,
        13.082_530_086_123_308,
        0.202_285_033_063_261_93,
    ];
}
