//! Statistics as records: a struct whose fields are numbers or the reasons why they are
//! undefined, and from whose declaration identifiers, documents and schema follow.
//!
//! [`statistics!`] declares a record. A field is a [`Stat`], an [`Interval`], a [`List`],
//! another record, a map from names of the data to records, or an `Option` of one of these,
//! which an analysis may not have. The identifier of a statistic is the path of its fields:
//! `order_trial/slope`, `desc/M/mean`. `as "F"` gives a field another name in identifiers,
//! and `as ""` none, so that what it holds takes the identifier of its parent.
//!
//! How to move a group of statistics from [`Values`] to a record:
//!
//! 1. Declare the record in the file that computes it, with a doc comment for each field:
//!    it is the definition in docs/statistics*.md. What is listed although the whole group is
//!    undefined is a [`Stat`]; what is then left out is an `Option<Stat>`.
//! 2. The function that computes it returns it. A group that is undefined as a whole is
//!    `Record::undefined(why)`, and `..Record::undefined(why)` fills the rest of one that is not.
//! 3. Add it as a field of the record that holds its neighbors, up to
//!    [`super::results::Results`]: the compiler lists where that is made.
//! 4. Findings and reports read `results.order.trial.slope.number()` instead of a string.

pub use super::keys::{
    ContrastName, CovariateName, DuplicateName, EffectName, Key, LevelsName, OutcomeName, PairName,
    ParticipantName, RealizationName, ReferenceName, SiteName,
};
use super::values::{Value, Values};
use std::borrow::Cow;
use std::collections::BTreeMap;

/// Why a statistic is undefined.
pub type Why = Cow<'static, str>;

const OVERFLOW: Why = Cow::Borrowed("it overflows");

/// A finite number, or the reason why it is undefined.
#[derive(Debug, Clone, PartialEq)]
pub struct Stat(Result<f64, Why>);

impl Stat {
    /// A number that is always defined unless it overflows.
    pub fn of(x: f64) -> Self {
        Self(if x.is_finite() { Ok(x) } else { Err(OVERFLOW) })
    }

    /// A number that may be undefined.
    pub fn or(x: Option<f64>, why: impl Into<Why>) -> Self {
        x.map_or_else(|| Self::missing(why), Self::of)
    }

    /// 1 or 0.
    pub fn flag(yes: bool) -> Self {
        Self::of(f64::from(u8::from(yes)))
    }

    /// A count.
    pub fn count(n: usize) -> Self {
        Self::of(n as f64)
    }

    /// An undefined number.
    pub fn missing(why: impl Into<Why>) -> Self {
        Self(Err(why.into()))
    }

    /// Whether it is a flag that is set.
    pub fn is_set(&self) -> bool {
        self.0 == Ok(1.0)
    }
}

/// Reads a statistic that may be undefined, or may not be part of the analysis.
pub trait Number {
    /// Its value, if it is defined.
    fn number(&self) -> Option<f64>;
    /// Why it is undefined.
    fn reason(&self) -> Option<&str>;
}

impl Number for Stat {
    fn number(&self) -> Option<f64> {
        self.0.as_ref().ok().copied()
    }

    fn reason(&self) -> Option<&str> {
        self.0.as_ref().err().map(AsRef::as_ref)
    }
}

impl<T: Number> Number for Option<T> {
    fn number(&self) -> Option<f64> {
        self.as_ref()?.number()
    }

    fn reason(&self) -> Option<&str> {
        self.as_ref()?.reason()
    }
}

impl<T: Number> Number for &T {
    fn number(&self) -> Option<f64> {
        (**self).number()
    }

    fn reason(&self) -> Option<&str> {
        (**self).reason()
    }
}

/// The bounds of an interval, with the identifiers `NAME_lo` and `NAME_hi`.
#[derive(Debug, Clone, PartialEq)]
pub struct Interval {
    /// The lower bound.
    pub lo: Stat,
    /// The upper bound.
    pub hi: Stat,
}

impl Interval {
    /// An interval that may be undefined.
    pub fn or(ends: Option<(f64, f64)>, why: impl Into<Why>) -> Self {
        let why = why.into();
        Self {
            lo: Stat::or(ends.map(|e| e.0), why.clone()),
            hi: Stat::or(ends.map(|e| e.1), why),
        }
    }

    /// Both bounds, if they are defined.
    pub fn ends(&self) -> Option<(f64, f64)> {
        self.lo.number().zip(self.hi.number())
    }
}

/// Finite numbers, or the reason why they are undefined.
#[derive(Debug, Clone, PartialEq)]
pub struct List(Result<Vec<f64>, Why>);

impl List {
    /// Numbers that are always defined unless one overflows.
    pub fn of(list: Vec<f64>) -> Self {
        let finite = list.iter().all(|x| x.is_finite());
        Self(if finite { Ok(list) } else { Err(OVERFLOW) })
    }

    /// The numbers, if they are defined.
    pub fn numbers(&self) -> Option<&[f64]> {
        self.0.as_ref().ok().map(AsRef::as_ref)
    }
}

/// The statistics of an analysis as they are declared: the lines of a reference.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Declared {
    /// A record, and what it is about.
    Group {
        /// Its identifier, with placeholders for names: `desc/M`.
        id: String,
        /// What it is here.
        doc: &'static str,
        /// What such a record is.
        about: &'static str,
        /// The type of the record.
        record: &'static str,
        /// How many of the declarations after it are its own.
        own: usize,
    },
    /// A statistic of the group before it.
    Statistic {
        /// Its identifier.
        id: String,
        /// What it is.
        doc: &'static str,
        /// Whether it is a list of numbers.
        list: bool,
    },
}

/// A field of a record.
pub trait Field: Sized {
    /// The field of a group that is undefined as a whole.
    fn undefined(why: &Why) -> Self;
    /// Adds its statistics, whose identifiers are or begin with `id`.
    fn put(&self, id: &str, values: &mut Values);
    /// Replaces the reasons of what is undefined.
    fn explain(&mut self, why: &Why);
    /// Adds its declaration.
    fn declare(id: &str, doc: &'static str, all: &mut Vec<Declared>);

    /// Its statistics by identifier.
    fn values(&self) -> Values {
        let mut values = Values::default();
        self.put("", &mut values);
        values
    }
}

impl Field for Stat {
    fn undefined(why: &Why) -> Self {
        Self(Err(why.clone()))
    }

    fn put(&self, id: &str, values: &mut Values) {
        let value = match &self.0 {
            Ok(x) => Value::Number(*x),
            Err(why) => Value::Undefined(why.clone().into_owned()),
        };
        values.insert(id.to_owned(), value);
    }

    fn explain(&mut self, why: &Why) {
        if self.0.is_err() {
            self.0 = Err(why.clone());
        }
    }

    fn declare(id: &str, doc: &'static str, all: &mut Vec<Declared>) {
        let (id, list) = (id.to_owned(), false);
        all.push(Declared::Statistic { id, doc, list });
    }
}

impl Field for Interval {
    fn undefined(why: &Why) -> Self {
        Self::or(None, why.clone())
    }

    fn put(&self, id: &str, values: &mut Values) {
        self.lo.put(&format!("{id}_lo"), values);
        self.hi.put(&format!("{id}_hi"), values);
    }

    fn explain(&mut self, why: &Why) {
        self.lo.explain(why);
        self.hi.explain(why);
    }

    fn declare(id: &str, doc: &'static str, all: &mut Vec<Declared>) {
        Stat::declare(&format!("{id}_lo"), doc, all);
        Stat::declare(&format!("{id}_hi"), doc, all);
    }
}

impl Field for List {
    fn undefined(why: &Why) -> Self {
        Self(Err(why.clone()))
    }

    fn put(&self, id: &str, values: &mut Values) {
        let value = match &self.0 {
            Ok(list) => Value::List(list.clone()),
            Err(why) => Value::Undefined(why.clone().into_owned()),
        };
        values.insert(id.to_owned(), value);
    }

    fn explain(&mut self, why: &Why) {
        if self.0.is_err() {
            self.0 = Err(why.clone());
        }
    }

    fn declare(id: &str, doc: &'static str, all: &mut Vec<Declared>) {
        let (id, list) = (id.to_owned(), true);
        all.push(Declared::Statistic { id, doc, list });
    }
}

impl<T: Field> Field for Option<T> {
    fn undefined(_: &Why) -> Self {
        None
    }

    fn put(&self, id: &str, values: &mut Values) {
        if let Some(field) = self {
            field.put(id, values);
        }
    }

    fn explain(&mut self, why: &Why) {
        if let Some(field) = self {
            field.explain(why);
        }
    }

    fn declare(id: &str, doc: &'static str, all: &mut Vec<Declared>) {
        T::declare(id, doc, all);
    }
}

impl<T: Field> Field for Box<T> {
    fn undefined(why: &Why) -> Self {
        Self::new(T::undefined(why))
    }

    fn put(&self, id: &str, values: &mut Values) {
        (**self).put(id, values);
    }

    fn explain(&mut self, why: &Why) {
        (**self).explain(why);
    }

    fn declare(id: &str, doc: &'static str, all: &mut Vec<Declared>) {
        T::declare(id, doc, all);
    }
}

impl<K: Key, R: Field> Field for BTreeMap<K, R> {
    fn undefined(_: &Why) -> Self {
        Self::new()
    }

    fn put(&self, id: &str, values: &mut Values) {
        for (key, record) in self {
            record.put(&join(id, &key.part()), values);
        }
    }

    fn explain(&mut self, why: &Why) {
        for record in self.values_mut() {
            record.explain(why);
        }
    }

    fn declare(id: &str, doc: &'static str, all: &mut Vec<Declared>) {
        R::declare(&join(id, K::PLACEHOLDER), doc, all);
    }
}

/// An identifier and the name of a part, one of which may be empty.
pub(in crate::analyze) fn join<'a>(id: &'a str, name: &'a str) -> Cow<'a, str> {
    match (id, name) {
        (id, "") => Cow::Borrowed(id),
        ("", name) => Cow::Borrowed(name),
        _ => Cow::Owned(format!("{id}/{name}")),
    }
}

/// Declares records of statistics; see [the module](self).
macro_rules! statistics {
    ($(
        $(#[doc = $about:literal])+
        pub struct $record:ident {
            $($(#[doc = $doc:literal])+ $field:ident: $type:ty $(as $name:literal)?,)*
        }
    )*) => {$(
        $(#[doc = $about])+
        #[derive(Debug, Clone, PartialEq)]
        pub struct $record {
            $($(#[doc = $doc])+ pub $field: $type,)*
        }

        impl $record {
            /// The record of a group that is undefined as a whole.
            #[allow(dead_code, reason = "not every group can be undefined as a whole")]
            pub(in crate::analyze) fn undefined(why: impl Into<$crate::analyze::record::Why>) -> Self {
                <Self as $crate::analyze::record::Field>::undefined(&why.into())
            }
        }

        impl $crate::analyze::record::Field for $record {
            fn undefined(why: &$crate::analyze::record::Why) -> Self {
                Self { $($field: $crate::analyze::record::Field::undefined(why),)* }
            }

            fn put(&self, id: &str, values: &mut $crate::analyze::values::Values) {
                use $crate::analyze::record::{Field, join};
                $(Field::put(&self.$field, &join(id, $crate::analyze::record::name_of!($field $($name)?)), values);)*
            }

            fn explain(&mut self, why: &$crate::analyze::record::Why) {
                $($crate::analyze::record::Field::explain(&mut self.$field, why);)*
            }

            fn declare(
                id: &str,
                doc: &'static str,
                all: &mut Vec<$crate::analyze::record::Declared>,
            ) {
                use $crate::analyze::record::{Declared, Field, join};
                let at = all.len();
                all.push(Declared::Group {
                    id: id.to_owned(),
                    doc,
                    about: concat!($($about, "\n"),+),
                    record: std::any::type_name::<Self>(),
                    own: 0,
                });
                $(<$type as Field>::declare(
                    &join(id, $crate::analyze::record::name_of!($field $($name)?)),
                    concat!($($doc, "\n"),+),
                    all,
                );)*
                let after = all.len();
                if let Some(Declared::Group { own, .. }) = all.get_mut(at) {
                    *own = after - at - 1;
                }
            }
        }
    )*};
}

/// The name of a field in identifiers.
macro_rules! name_of {
    ($field:ident) => {
        stringify!($field)
    };
    ($field:ident $name:literal) => {
        $name
    };
}

pub(in crate::analyze) use {name_of, statistics};

#[cfg(test)]
#[allow(unreachable_pub, reason = "records are public")]
mod tests {
    use super::*;

    statistics! {
        /// A record.
        pub struct Inner {
            /// a number
            n: Stat,
            /// its interval
            ci95: Interval,
            /// numbers
            hist: Option<List>,
        }
        /// A record of records.
        pub struct Outer {
            /// by realization
            by_name: BTreeMap<RealizationName, Inner> as "desc",
            /// by pair
            pairs: BTreeMap<PairName, Inner> as "pair",
            /// without a name of its own
            flat: Option<Inner> as "",
        }
    }

    fn outer() -> Outer {
        let one = Inner {
            n: Stat::of(2.0),
            hist: Some(List::of(vec![1.0, f64::NAN])),
            ..Inner::undefined("too few")
        };
        Outer {
            by_name: [("a/b".into(), one.clone())].into(),
            pairs: [(PairName::of("b", "a|c"), Inner::undefined("none"))].into(),
            flat: Some(one),
        }
    }

    #[test]
    fn identifiers_are_the_path_of_fields_and_names() {
        let mut values = Values::default();
        outer().put("x", &mut values);
        let found: Vec<String> = (values.iter())
            .map(|(id, value)| format!("{id} {value:?}"))
            .collect();
        let expected = [
            "x/ci95_hi Undefined(\"too few\")",
            "x/ci95_lo Undefined(\"too few\")",
            "x/desc/a%2Fb/ci95_hi Undefined(\"too few\")",
            "x/desc/a%2Fb/ci95_lo Undefined(\"too few\")",
            "x/desc/a%2Fb/hist Undefined(\"it overflows\")",
            "x/desc/a%2Fb/n Number(2.0)",
            "x/hist Undefined(\"it overflows\")",
            "x/n Number(2.0)",
            "x/pair/a%7Cc|b/ci95_hi Undefined(\"none\")",
            "x/pair/a%7Cc|b/ci95_lo Undefined(\"none\")",
            "x/pair/a%7Cc|b/n Undefined(\"none\")",
        ];
        assert_eq!(found, expected);
    }

    #[test]
    fn records_are_read_by_the_names_of_the_data() {
        let outer = outer();
        assert_eq!(outer.by_name["a/b"].n.number(), Some(2.0));
        assert_eq!(outer.by_name["a/b"].ci95.lo.reason(), Some("too few"));
        assert_eq!(outer.by_name["a/b"].ci95.ends(), None);
        let pair = &outer.pairs[&PairName::of("a|c", "b")];
        assert_eq!(pair.hist, None);
        assert!(Stat::flag(true).is_set() && !Stat::of(f64::INFINITY).is_set());
    }

    #[test]
    fn a_reason_replaces_those_of_undefined_numbers_only() {
        let mut outer = outer();
        outer.explain(&"too large".into());
        let own = &outer.by_name["a/b"];
        assert_eq!(own.n.number(), Some(2.0));
        assert_eq!(own.ci95.hi.reason(), Some("too large"));
        assert_eq!(own.hist, Some(List(Err("too large".into()))));
    }

    #[test]
    fn a_declaration_lists_what_a_record_can_hold() {
        let mut all = Vec::new();
        Outer::declare("x", "outer", &mut all);
        let ids: Vec<&str> = (all.iter())
            .map(|d| match d {
                Declared::Group { id, .. } | Declared::Statistic { id, .. } => id.as_str(),
            })
            .collect();
        assert_eq!(ids[..3], ["x", "x/desc/M", "x/desc/M/n"]);
        assert!(ids.contains(&"x/pair/a|b/ci95_lo") && ids.contains(&"x/hist"));
        let doc = |id: &str, doc: &'static str, list: bool| Declared::Statistic {
            id: id.to_owned(),
            doc,
            list,
        };
        assert!(all.contains(&doc("x/hist", " numbers\n", true)));
    }
}
