//! The ratings of several sites as one table.

use super::build::sort;
use super::{IndexedPracticeRow, Practice, Ratings};
use std::sync::Arc;

/// The name of a participant of a site: the same id at two sites is two persons.
fn name(site: &str, id: &str) -> String {
    format!("{site}:{id}")
}

impl Ratings {
    /// The ratings of sites, by name, that rated the same realizations for the same
    /// question. Participants get the name `SITE:ID`.
    #[must_use]
    pub fn pooled(sites: &[(String, Self)]) -> Self {
        let mut all = Self {
            question: (sites.first()).map_or_else(String::new, |(_, r)| r.question.clone()),
            sites: sites.iter().map(|(name, _)| name.clone()).collect(),
            ..Self::default()
        };
        let mut practice = Practice::default();
        for (number, (site, own)) in (0u32..).zip(sites) {
            let (rows, before) = (all.len(), all.subjects.len() as u32);
            all.subjects.extend(own.subjects.iter().map(|s| {
                let mut subject = s.clone();
                subject.id = name(site, &s.id);
                subject.site = Some(number);
                subject
            }));
            let places: Vec<u32> = (own.models.iter())
                .map(|m| {
                    let known = all.models.iter().position(|other| other.id == m.id);
                    known.unwrap_or_else(|| {
                        all.models.push(m.clone());
                        all.models.len() - 1
                    }) as u32
                })
                .collect();
            all.extend(own);
            for subject in &mut all.subject[rows..] {
                *subject += before;
            }
            for model in all.model[rows..].iter_mut().flatten() {
                *model = places[*model as usize];
            }
            all.comments.extend(own.comments.iter().map(|c| {
                let mut comment = c.clone();
                comment.row += rows;
                comment
            }));
            practice.append(&own.practice, site);
        }
        all.practice = Arc::new(practice);
        let subjects = sort(&mut all.subjects, |s| &s.id);
        let models = sort(&mut all.models, |m| &m.id);
        for s in &mut all.subject {
            *s = subjects[*s as usize];
        }
        for m in all.model.iter_mut().flatten() {
            *m = models[*m as usize];
        }
        all
    }
}

impl Practice {
    /// Adds the practice rows of a site.
    fn append(&mut self, other: &Self, site: &str) {
        for row in &other.rows {
            let mut index = |name: String| {
                let known = self.names.iter().position(|n| *n == name);
                known.unwrap_or_else(|| {
                    self.names.push(name);
                    self.names.len() - 1
                }) as u32
            };
            let of = |at: u32| other.names.get(at as usize).map_or("", String::as_str);
            let subject = index(name(site, of(row.subject)));
            let model = index(of(row.model).to_owned());
            self.rows.push(IndexedPracticeRow {
                subject,
                model,
                ..*row
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(rows: &str) -> Ratings {
        let csv = format!("subject,model,repetition,rating,vaf,comment\n{rows}");
        Ratings::read_csv("t.csv", csv.as_bytes(), None).unwrap()
    }

    #[test]
    fn the_same_id_at_two_sites_is_two_participants() {
        let a = table("P1,y,1,3,0.9,\nP1,x,1,4,0.8,good\n");
        let b = table("P1,x,1,5,0.8,bad\nP2,y,1,6,0.9,\n");
        let both = Ratings::pooled(&[("utah".to_owned(), a), ("bern".to_owned(), b)]);
        let named: Vec<(&str, Option<u32>)> = (both.subjects.iter())
            .map(|s| (s.id.as_str(), s.site))
            .collect();
        let expected = [
            ("bern:P1", Some(1)),
            ("bern:P2", Some(1)),
            ("utah:P1", Some(0)),
        ];
        assert_eq!(named, expected);
        assert_eq!(both.sites, ["utah", "bern"]);
        let rows: Vec<(&str, &str, Option<f64>)> = (0..both.len())
            .map(|i| {
                let subject = &both.subjects[both.subject[i] as usize].id;
                let model = &both.models[both.model[i].unwrap() as usize].id;
                (subject.as_str(), model.as_str(), both.rating[i])
            })
            .collect();
        assert_eq!(
            rows,
            [
                ("utah:P1", "y", Some(3.0)),
                ("utah:P1", "x", Some(4.0)),
                ("bern:P1", "x", Some(5.0)),
                ("bern:P2", "y", Some(6.0)),
            ]
        );
        assert_eq!(both.vaf, [0.9, 0.8, 0.8, 0.9].map(Some));
        let kept = both.keep(|i| both.rating[i] != Some(3.0));
        assert_eq!(kept.sites, both.sites);
        assert_eq!(kept.subjects[0].site, Some(1));
    }
}
