//! Several sites: `site/NAME/*`, `site_mean/NAME/REALIZATION/*` and what differs between
//! them, `site_level/*`, `site_realizations/*`, `site_vaf/*`.
//!
//! A site is a factor between participants. Its level is compared by the participants'
//! means, its pattern by the interaction of site and realization in the analysis of variance
//! between and within participants, its effect of VAF by the participants' slopes. All three
//! rest on the participants who rated every tested realization.

use super::Rules;
use super::cells::{Cells, CompleteTable};
use super::draws::Draws;
use super::record::{Interval, Number as _, RealizationName, SiteName, Stat, statistics};
use std::collections::BTreeMap;
use study_stats::between::{self, Between};
use study_stats::correlation::pearson;
use study_stats::describe::{is_constant, mean, sd};
use study_stats::paired::one_sample;
use study_stats::permutation::{self, Statistic};
use study_stats::regression::slope;

/// Why a comparison of sites is undefined.
const FEW: &str =
    "a site has nobody who rated every realization, or no site has two, or nothing varies";

const FEW_VAF: &str =
    "fewer than three realizations with a VAF, all have the same, or one was not rated there";

statistics! {
    /// The means of the participants of a site.
    pub struct SiteMean {
        /// participants
        n: Stat,
        /// those who rated every tested realization
        n_complete: Option<Stat>,
        /// mean over participants
        mean: Stat,
        /// n − 1
        sd: Stat,
        /// t interval
        ci95: Interval,
    }

    /// F between sites. Compared with `anova.mlm`, `aov` and `t.test` of R 4.2.2 (1e-9).
    pub struct SiteTest {
        /// the statistic
        f: Stat as "F",
        /// of the sites
        df1: Stat,
        /// of the error
        df2: Stat,
        /// of `F`
        p: Stat,
        /// partial η²
        pes: Stat,
    }

    /// Two sites.
    pub struct SiteDifference {
        /// first site minus second
        difference: Stat,
        /// with the variance within both
        difference_ci95: Interval,
    }

    /// Whether the sites differ in one number of each participant.
    pub struct SiteLevels {
        /// over all sites
        test: SiteTest as "",
        /// of two
        difference: SiteDifference as "",
    }

    /// The interaction of site and realization in the analysis of variance of the complete participants' cell means, between and within participants.
    pub struct SiteProfiles {
        /// without correction
        test: SiteTest as "",
        /// ε from the covariance within sites
        eps_gg: Stat,
        /// with this correction
        p_gg: Stat,
    }

    /// The effect of VAF at a site.
    pub struct VafOfSite {
        /// correlation of VAF with the means of the site
        r: Stat,
        /// permutation p
        p_two_sided: Stat,
        /// mean slope of its complete participants
        slope: Stat,
        /// its interval
        slope_ci95: Interval,
    }

    /// The effect of VAF by site.
    pub struct VafOfSites {
        /// at each site
        by_site: BTreeMap<SiteName, VafOfSite> as "",
        /// of the participants' slopes
        levels: SiteLevels as "",
    }

    /// Sites, only with `--pool`.
    pub struct Sites {
        /// over all tested realizations
        site: BTreeMap<SiteName, SiteMean>,
        /// of each
        site_mean: BTreeMap<SiteName, BTreeMap<RealizationName, SiteMean>>,
        /// the participants' means
        level: SiteLevels as "site_level",
        /// the pattern of the realizations
        realizations: SiteProfiles as "site_realizations",
        /// the effect of VAF
        vaf: VafOfSites as "site_vaf",
    }
}

pub(super) fn sites(cells: &Cells<'_>, rules: &Rules) -> Option<Sites> {
    let names = &cells.ratings.sites;
    if names.is_empty() {
        return None;
    }
    let models = cells.tested();
    let table = cells.table(&models);
    let groups: Vec<Vec<&[f64]>> = (0..names.len())
        .map(|site| of_site(cells, &table, site).collect())
        .collect();
    let (mut of_sites, mut of_realizations) = (BTreeMap::new(), BTreeMap::new());
    for (site, name) in names.iter().enumerate() {
        let (all, each) = describe(cells, site, groups[site].len());
        of_sites.insert(name.as_str().into(), all);
        of_realizations.insert(name.as_str().into(), each);
    }
    let means = |site: usize| -> Vec<f64> {
        let rows = groups[site].iter();
        rows.filter_map(|row| mean(row)).collect()
    };
    let profiles = between::profiles(&groups);
    Some(Sites {
        vaf: vaf(cells, &models, &of_realizations, rules),
        site: of_sites,
        site_mean: of_realizations,
        level: SiteLevels {
            test: tested(between::levels(&groups).as_ref()),
            difference: difference(names.len(), means),
        },
        realizations: SiteProfiles {
            test: tested(profiles.as_ref()),
            eps_gg: Stat::or(profiles.as_ref().and_then(|e| e.eps_gg), FEW),
            p_gg: Stat::or(profiles.as_ref().and_then(|e| e.p_gg), FEW),
        },
    })
}

/// The complete participants of a site.
fn of_site<'t>(
    cells: &'t Cells<'_>,
    table: &'t CompleteTable,
    site: usize,
) -> impl Iterator<Item = &'t [f64]> {
    let rows = table.subjects.iter().zip(&table.rows);
    rows.filter(move |(s, _)| cells.ratings.subjects[**s].site == Some(site as u32))
        .map(|(_, row)| row.as_slice())
}

/// Participants and means of a site.
fn describe(
    cells: &Cells<'_>,
    site: usize,
    complete: usize,
) -> (SiteMean, BTreeMap<RealizationName, SiteMean>) {
    let subjects = &cells.ratings.subjects;
    let own = |s: usize| subjects[s].site == Some(site as u32);
    let models = cells.tested();
    let mut of_participants = Vec::new();
    let mut of_realizations = vec![Vec::new(); models.len()];
    for cells in cells.cells.chunk_by(|a, b| a.subject == b.subject) {
        let mut means = Vec::new();
        for cell in cells.iter().filter(|c| own(c.subject)) {
            if let Ok(j) = models.binary_search(&cell.model) {
                means.push(cell.mean);
                of_realizations[j].push(cell.mean);
            }
        }
        of_participants.extend(mean(&means));
    }
    let all = SiteMean {
        n_complete: Some(Stat::count(complete)),
        ..site_mean(&of_participants, cells.offset, "no participants")
    };
    let each = models.iter().zip(&of_realizations).map(|(m, means)| {
        let mean = site_mean(means, cells.offset, "nobody rated it there");
        (cells.model_name(*m).into(), mean)
    });
    (all, each.collect())
}

fn site_mean(means: &[f64], offset: f64, nobody: &'static str) -> SiteMean {
    let few = "fewer than two participants";
    let back = |mean: f64| mean + offset;
    let ci = one_sample(means).map(|t| (back(t.ci95.0), back(t.ci95.1)));
    SiteMean {
        n: Stat::count(means.len()),
        n_complete: None,
        mean: Stat::or(mean(means).map(back), nobody),
        sd: Stat::or(sd(means), few),
        ci95: Interval::or(ci, few),
    }
}

/// VAF: the correlation over realizations and the participants' slopes of each site, and
/// whether the slopes differ.
fn vaf(
    cells: &Cells<'_>,
    models: &[usize],
    site_means: &BTreeMap<SiteName, BTreeMap<RealizationName, SiteMean>>,
    rules: &Rules,
) -> VafOfSites {
    let names = &cells.ratings.sites;
    let with: Vec<usize> = (models.iter().copied())
        .filter(|&m| cells.vaf[m].is_some())
        .collect();
    let x: Vec<f64> = with.iter().filter_map(|&m| cells.vaf[m]).collect();
    let enough = x.len() >= 3 && !is_constant(&x);
    let table = cells.table(&with);
    let slopes = |site: usize| -> Vec<f64> {
        let rows = of_site(cells, &table, site);
        rows.filter_map(|row| slope(&x, row).filter(|_| enough))
            .collect()
    };
    let of_site = |(site, name): (usize, &String)| {
        let own = site_means.get(name.as_str());
        let get = |m: &usize| own?.get(cells.model_name(*m))?.mean.number();
        let means: Option<Vec<f64>> = with.iter().map(get).collect();
        let means = means.filter(|_| enough);
        let test = means.as_ref().and_then(|y| {
            let mut draws = Draws::new(rules.seed, "permutation");
            permutation::test(Statistic::Pearson, &x, y, &mut draws)
        });
        let own = one_sample(&slopes(site));
        let of_site = VafOfSite {
            r: Stat::or(means.as_ref().and_then(|y| pearson(&x, y)), FEW_VAF),
            p_two_sided: Stat::or(test.map(|t| t.two_sided), FEW_VAF),
            slope: Stat::or(own.map(|t| t.mean), FEW_VAF),
            slope_ci95: Interval::or(own.map(|t| t.ci95), FEW_VAF),
        };
        (name.as_str().into(), of_site)
    };
    let groups: Vec<Vec<f64>> = (0..names.len()).map(&slopes).collect();
    let test = between::one_way(&groups).filter(|_| enough);
    VafOfSites {
        by_site: names.iter().enumerate().map(of_site).collect(),
        levels: SiteLevels {
            test: tested(test.as_ref()),
            difference: difference(names.len(), slopes),
        },
    }
}

fn tested(test: Option<&Between>) -> SiteTest {
    SiteTest {
        f: Stat::or(test.and_then(|t| t.f), FEW),
        df1: Stat::or(test.map(|t| t.df1), FEW),
        df2: Stat::or(test.map(|t| t.df2), FEW),
        p: Stat::or(test.and_then(|t| t.p), FEW),
        pes: Stat::or(test.and_then(Between::pes), FEW),
    }
}

/// First of two sites minus the second, in one number of each participant.
fn difference(sites: usize, of: impl Fn(usize) -> Vec<f64>) -> SiteDifference {
    let found = match sites {
        2 => between::difference(&of(0), &of(1)),
        _ => None,
    };
    let why = "there are not two sites with a variance";
    SiteDifference {
        difference: Stat::or(found.as_ref().map(|d| d.difference), why),
        difference_ci95: Interval::or(found.as_ref().map(|d| d.ci95), why),
    }
}

#[cfg(test)]
mod tests {
    use crate::analyze::{Question, Rules, TestKind, analyze};
    use study_session::outcome::ratings::Ratings;

    /// A site whose participants rated three realizations with VAF .6, .75, .8.
    fn site(rows: &[[f64; 3]]) -> Ratings {
        let mut csv = "subject,model,repetition,rating,vaf\n".to_owned();
        for (i, row) in rows.iter().enumerate() {
            for (j, rating) in row.iter().enumerate() {
                let vaf = [0.6, 0.75, 0.8][j];
                csv += &format!("P{i},m{j},1,{rating},{vaf}\n");
            }
        }
        Ratings::read_csv("site.csv", csv.as_bytes(), None).unwrap()
    }

    /// R 4.2.2: anova(lm(Y ~ site), lm(Y ~ 1), X = ~1, test = "Spherical"),
    /// anova(lm(rowMeans(Y) ~ site)), anova(lm(slope ~ site)), t.test(…, var.equal = TRUE).
    #[test]
    fn comparisons_of_sites_agree_with_r() {
        let utah = site(&[
            [4.0, 5.0, 6.5],
            [3.0, 5.0, 5.5],
            [5.0, 4.5, 7.0],
            [2.0, 4.0, 6.0],
        ]);
        let bern = site(&[[3.0, 4.0, 4.0], [5.0, 4.5, 5.5], [4.0, 5.5, 3.5]]);
        let pooled = Ratings::pooled(&[("utah".to_owned(), utah), ("bern".to_owned(), bern)]);
        let a = analyze(&pooled, &Rules::default());
        let close = |id: &str, expected: f64, tolerance: f64| {
            let found = a.values.number(id).unwrap_or_else(|| panic!("{id}"));
            assert!((found - expected).abs() < tolerance, "{id}: {found}");
        };
        close("site_realizations/F", 5.096_670_247_038_9, 1e-9);
        close("site_realizations/p_gg", 0.037_547_846_785_019, 1e-9);
        close("site_level/F", 0.802_742_149_491_37, 1e-9);
        close("site_level/p", 0.411_330_370_273_09, 1e-9);
        close("site_level/difference_ci95_lo", -0.856_663_915_798_74, 1e-9);
        close("site_vaf/F", 10.346_94, 5e-6);
        close("site_vaf/p", 0.023_553, 5e-7);
        close("site_vaf/difference", 10.0, 1e-9);
        close("site_vaf/difference_ci95_lo", 2.008_551_689_653_8, 1e-9);
        close("site_vaf/utah/slope", 12.307_692_307_692_3, 1e-9);
        close("site_mean/bern/m1/mean", 14.0 / 3.0, 1e-12);
        close("site/bern/n", 3.0, 1e-12);
        let yes = |question| a.finding(&question).unwrap().is_yes();
        assert!(yes(Question::SiteRealizations) && yes(Question::SiteVaf));
        assert!(!yes(Question::SiteLevel));
        // What the sites have in common rests on all seven.
        assert_eq!(a.finding(&Question::Differ).unwrap().participants, 7);
    }

    /// Three unequal sites, two repetitions; a participant of the second did not rate all. R 4.2.2:
    /// the interaction is that of lmer(cell mean ~ site * model + (1 | participant)) with lmerTest
    /// 3.1.3 (1e-7, where its search stops), whose p is uncorrected, and of
    /// anova(lm(Y ~ site), lm(Y ~ 1), X = ~1, test = "Spherical"), which has both (1e-9); slopes and
    /// means by anova(lm(… ~ site)) (1e-9). What decides is p with the correction.
    #[test]
    fn the_deciding_tests_of_three_sites_agree_with_r() {
        let site = |rows: &[&[f64]]| {
            let mut csv = "subject,model,repetition,rating,vaf\n".to_owned();
            for (i, row) in rows.iter().enumerate() {
                for (k, rating) in row.iter().enumerate() {
                    let (j, vaf) = (k / 2, [0.62, 0.7, 0.81, 0.9][k / 2]);
                    csv += &format!("P{i},m{j},{},{rating},{vaf}\n", k % 2 + 1);
                }
            }
            Ratings::read_csv("site.csv", csv.as_bytes(), None).unwrap()
        };
        let a = site(&[
            &[4.0, 4.5, 3.5, 4.5, 4.5, 5.0, 5.0, 6.0],
            &[2.5, 2.5, 3.0, 3.0, 3.5, 3.5, 3.0, 3.0],
            &[2.5, 2.5, 2.0, 2.0, 3.0, 2.5, 3.0, 2.5],
            &[3.5, 3.5, 4.5, 4.0, 5.0, 5.0, 5.5, 5.5],
            &[4.0, 4.0, 4.5, 4.0, 4.5, 6.0, 5.5, 4.5],
        ]);
        let b = site(&[
            &[4.5, 5.5, 4.5, 4.5, 4.5, 4.0, 5.5, 5.5],
            &[4.5, 4.5, 5.5, 4.0, 4.5, 4.5, 5.0, 5.0],
            &[3.5, 4.0, 4.5, 4.0, 4.0, 4.5, 4.5, 4.5],
            &[3.5, 3.0, 4.5, 4.0, 4.0, 4.5, 4.5, 4.0],
            &[1.0, 7.0, 1.0, 7.0, 2.0, 6.0],
        ]);
        let c = site(&[
            &[3.0, 3.0, 4.0, 5.0, 3.5, 3.5, 4.5, 5.0],
            &[3.0, 2.5, 3.5, 4.0, 3.5, 4.5, 5.0, 4.0],
            &[3.0, 3.0, 5.0, 4.5, 5.5, 6.0, 5.5, 5.5],
            &[3.5, 3.5, 3.5, 3.5, 5.0, 5.5, 6.0, 6.0],
            &[3.0, 3.0, 3.5, 2.5, 4.5, 4.0, 5.5, 5.0],
            &[2.5, 2.0, 3.0, 2.5, 5.0, 5.5, 5.0, 4.5],
        ]);
        let of = |alpha: f64| {
            let sites = [("a", a.clone()), ("b", b.clone()), ("c", c.clone())];
            let sites = sites.map(|(name, table)| (name.to_owned(), table));
            let rules = Rules {
                alpha,
                ..Rules::default()
            };
            analyze(&Ratings::pooled(&sites), &rules)
        };
        let found = of(0.05);
        let close = |id: &str, expected: f64, tolerance: f64| {
            let value = found.values.number(id).unwrap_or_else(|| panic!("{id}"));
            assert!((value / expected - 1.0).abs() < tolerance, "{id}: {value}");
        };
        close("site_realizations/F", 3.609_557_299_215_888, 1e-7);
        close("site_realizations/p", 6.632_647_172_204_91e-3, 1e-7);
        close("site_realizations/F", 3.609_557_290_856_49, 1e-9);
        close("site_realizations/p_gg", 1.242_956_289_688e-2, 1e-9);
        close("site_level/F", 0.736_310_063_984_012, 1e-9);
        close("site_level/p", 0.499_315_546_597_2, 1e-9);
        close("site_vaf/F", 10.661_998_859_042_3, 1e-9);
        close("site_vaf/p", 2.180_443_812_713_09e-3, 1e-9);
        // Between both p of the interaction the corrected one decides; the slopes decide about VAF.
        let strict = of(0.01);
        for (question, id, kind, yes) in [
            (
                Question::SiteRealizations,
                "site_realizations/p_gg",
                TestKind::BetweenWithin,
                [true, false],
            ),
            (
                Question::SiteVaf,
                "site_vaf/p",
                TestKind::BetweenSites,
                [true, true],
            ),
            (
                Question::SiteLevel,
                "site_level/p",
                TestKind::BetweenSites,
                [false, false],
            ),
        ] {
            for (analysis, yes) in [&found, &strict].into_iter().zip(yes) {
                let finding = analysis.finding(&question).unwrap();
                let test = finding.test.as_ref().unwrap();
                assert_eq!((test.kind, finding.is_yes()), (kind, yes), "{id}");
                assert_eq!(Some(test.p), analysis.values.number(id), "{id}");
                assert_eq!(finding.participants, 15, "{id}");
                assert!(finding.caveats.iter().any(|c| c.code == "complete-only"));
            }
        }
    }

    /// Without a factor there is nothing about sites; a site of one participant still has
    /// the variance of the other.
    #[test]
    fn few_participants_have_a_reason() {
        let one = || site(&[[4.0, 5.0, 6.5]]);
        let alone = analyze(&one(), &Rules::default());
        assert!(alone.finding(&Question::SiteLevel).is_none());
        assert!(alone.values.iter().all(|(id, _)| !id.starts_with("site")));
        let of = |a: Ratings, b: Ratings| {
            let pooled = Ratings::pooled(&[("a".to_owned(), a), ("b".to_owned(), b)]);
            analyze(&pooled, &Rules::default())
        };
        let both = of(one(), one());
        let found = both.finding(&Question::SiteRealizations).unwrap();
        assert!(found.reason().is_some() && found.test.is_none());
        let three = of(one(), site(&[[3.0, 4.0, 4.0], [5.0, 4.5, 5.5]]));
        assert!(
            three
                .finding(&Question::SiteRealizations)
                .unwrap()
                .test
                .is_some()
        );
    }
}
