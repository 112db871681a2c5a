//! Formulas of psychometric functions.
//!
//! `+ - * / ^` (also `−`, `·` and `×`), parentheses, `exp ln log10 sqrt abs Phi min max`; a product needs no
//! sign: `2 lambda`, `(1 - gamma)(1 - exp(-x))`. A result may be named, `psi = …`, and
//! parts may follow it: `psi = gamma + … t …; t = max(c, intensity)`, or `… where t = …`.

use super::{ProcedureError, normal_cdf};

/// Longest formula, in characters, and deepest nesting.
const MAX_LENGTH: usize = 2_000;
const MAX_DEPTH: usize = 50;
/// Most numbers and names, after the definitions are put in.
const MAX_TERMS: usize = 10_000;

/// A formula over named variables.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Formula {
    root: Term,
}

#[derive(Debug, Clone, PartialEq)]
enum Term {
    Number(f64),
    Variable(usize),
    Negative(Box<Term>),
    Binary(Binary, Box<(Term, Term)>),
    Call(Call, Vec<Term>),
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Binary {
    Sum,
    Difference,
    Product,
    Quotient,
    Power,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Call {
    Exp,
    Ln,
    Log10,
    Sqrt,
    Abs,
    Phi,
    Min,
    Max,
}

impl Call {
    fn named(name: &str) -> Option<Self> {
        Some(match name {
            "exp" => Self::Exp,
            "ln" => Self::Ln,
            "log10" => Self::Log10,
            "sqrt" => Self::Sqrt,
            "abs" => Self::Abs,
            "Phi" | "phi" | "Φ" => Self::Phi,
            "min" => Self::Min,
            "max" => Self::Max,
            _ => return None,
        })
    }
}

impl Formula {
    /// Reads a formula of variables with these names.
    pub(super) fn parse(text: &str, names: &[&str]) -> Result<Self, ProcedureError> {
        let tokens = tokens(text)?;
        // `name = …` parts, separated by ; or , outside of parentheses
        let mut parts: Vec<&[(Token, usize)]> = Vec::new();
        let (mut depth, mut from) = (0usize, 0);
        for (i, (token, _)) in tokens.iter().enumerate() {
            match token {
                Token::Sign('(') => depth += 1,
                Token::Sign(')') => depth = depth.saturating_sub(1),
                Token::Sign(';' | ',') if depth == 0 => {
                    parts.push(&tokens[from..i]);
                    from = i + 1;
                }
                _ => {}
            }
        }
        parts.push(&tokens[from..]);
        let mut main = None;
        let mut definitions = Vec::new();
        for part in parts {
            match part {
                [] => {}
                [(Token::Name(name), _), (Token::Sign('='), _), rest @ ..] if main.is_some() => {
                    definitions.push((name.as_str(), rest));
                }
                [(Token::Name(_), _), (Token::Sign('='), _), rest @ ..] => main = Some(rest),
                rest if main.is_none() => main = Some(rest),
                [(_, at), ..] => return Err(fault("a name and = expected", *at)),
            }
        }
        let mut reader = Reader {
            names,
            definitions: &definitions,
            depth: 0,
            terms: 0,
        };
        Ok(Self {
            root: reader.whole(main.unwrap_or_default(), text)?,
        })
    }

    /// The value at a stimulus and a combination of parameters.
    pub(super) fn value(&self, point: &[f64], cell: &[f64]) -> f64 {
        self.root.value(point, cell)
    }
}

impl Term {
    fn value(&self, point: &[f64], cell: &[f64]) -> f64 {
        match self {
            Self::Number(x) => *x,
            Self::Variable(i) => match i.checked_sub(point.len()) {
                Some(parameter) => cell[parameter],
                None => point[*i],
            },
            Self::Negative(x) => -x.value(point, cell),
            Self::Binary(sign, sides) => {
                let (a, b) = (sides.0.value(point, cell), sides.1.value(point, cell));
                match sign {
                    Binary::Sum => a + b,
                    Binary::Difference => a - b,
                    Binary::Product => a * b,
                    Binary::Quotient => a / b,
                    Binary::Power => libm::pow(a, b),
                }
            }
            Self::Call(call, arguments) => {
                let mut values = arguments.iter().map(|a| a.value(point, cell));
                let x = values.next().unwrap_or(0.0);
                match call {
                    Call::Exp => libm::exp(x),
                    Call::Ln => libm::log(x),
                    Call::Log10 => libm::log10(x),
                    Call::Sqrt => x.sqrt(),
                    Call::Abs => x.abs(),
                    Call::Phi => normal_cdf(x),
                    Call::Min => values.fold(x, f64::min),
                    Call::Max => values.fold(x, f64::max),
                }
            }
        }
    }
}

#[derive(Debug, Clone, PartialEq)]
enum Token {
    Number(f64),
    Name(String),
    Sign(char),
}

fn fault(what: impl Into<String>, at: usize) -> ProcedureError {
    ProcedureError::Formula {
        what: what.into(),
        at,
    }
}

/// The tokens, each with its place, counted from 1.
fn tokens(text: &str) -> Result<Vec<(Token, usize)>, ProcedureError> {
    let chars: Vec<char> = text.chars().collect();
    if chars.len() > MAX_LENGTH {
        return Err(fault("it is too long", MAX_LENGTH));
    }
    let mut found = Vec::new();
    let mut at = 0;
    while let Some(&c) = chars.get(at) {
        let start = at;
        let take = |good: &dyn Fn(usize) -> bool| {
            let end = (start..chars.len()).find(|i| !good(*i));
            end.unwrap_or(chars.len())
        };
        if c.is_ascii_digit() || c == '.' {
            at = take(&|i| {
                let exponent =
                    matches!(chars[i], '-' | '+') && i > start && matches!(chars[i - 1], 'e' | 'E');
                let mark = matches!(chars[i], 'e' | 'E')
                    && chars
                        .get(i + 1)
                        .is_some_and(|next| next.is_ascii_digit() || matches!(next, '-' | '+'));
                chars[i].is_ascii_digit() || chars[i] == '.' || exponent || mark
            });
            let number: String = chars[start..at].iter().collect();
            let value = (number.parse().ok()).filter(|v: &f64| v.is_finite());
            let value = value.ok_or_else(|| fault(format!("{number} is no number"), start + 1))?;
            found.push((Token::Number(value), start + 1));
        } else if c.is_alphabetic() || c == '_' {
            at = take(&|i| chars[i].is_alphanumeric() || chars[i] == '_');
            let name: String = chars[start..at].iter().collect();
            let token = match name.as_str() {
                "where" => Token::Sign(';'),
                _ => Token::Name(name),
            };
            found.push((token, start + 1));
        } else if "+-−*·×/^()[]=,;".contains(c) {
            at += 1;
            let sign = match c {
                '−' => '-',
                '·' | '×' => '*',
                '[' => '(',
                ']' => ')',
                other => other,
            };
            found.push((Token::Sign(sign), start + 1));
        } else if c.is_whitespace() {
            at += 1;
        } else {
            let what = format!("{:?} has no meaning here", c.escape_default().to_string());
            return Err(fault(what, start + 1));
        }
    }
    Ok(found)
}

/// Reads terms by precedence: sums, products, signs, powers.
struct Reader<'a> {
    names: &'a [&'a str],
    definitions: &'a [(&'a str, &'a [(Token, usize)])],
    depth: usize,
    terms: usize,
}

/// What is left to read.
type Rest<'a> = &'a [(Token, usize)];

impl<'a> Reader<'a> {
    fn whole(&mut self, tokens: Rest<'a>, text: &str) -> Result<Term, ProcedureError> {
        let mut rest = tokens;
        let term = self.sum(&mut rest, text)?;
        match rest.first() {
            None => Ok(term),
            Some((_, at)) => Err(fault("this was not expected", *at)),
        }
    }

    fn sum(&mut self, rest: &mut Rest<'a>, text: &str) -> Result<Term, ProcedureError> {
        let mut left = self.product(rest, text)?;
        while let Some(sign) = take(rest, &['+', '-']) {
            let right = self.product(rest, text)?;
            left = match sign {
                '+' => binary(Binary::Sum, left, right),
                _ => binary(Binary::Difference, left, right),
            };
        }
        Ok(left)
    }

    fn product(&mut self, rest: &mut Rest<'a>, text: &str) -> Result<Term, ProcedureError> {
        let mut left = self.signed(rest, text)?;
        loop {
            let sign = match take(rest, &['*', '/']) {
                Some('/') => Binary::Quotient,
                Some(_) => Binary::Product,
                None => match rest.first() {
                    Some((Token::Number(_) | Token::Name(_) | Token::Sign('('), _)) => {
                        Binary::Product
                    }
                    _ => return Ok(left),
                },
            };
            let right = self.signed(rest, text)?;
            left = binary(sign, left, right);
        }
    }

    fn signed(&mut self, rest: &mut Rest<'a>, text: &str) -> Result<Term, ProcedureError> {
        self.depth += 1;
        if self.depth > MAX_DEPTH {
            return Err(fault("it is nested too deeply", text.chars().count()));
        }
        let term = match take(rest, &['-']) {
            Some(_) => Ok(Term::Negative(Box::new(self.signed(rest, text)?))),
            None => self.power(rest, text),
        };
        self.depth -= 1;
        term
    }

    fn power(&mut self, rest: &mut Rest<'a>, text: &str) -> Result<Term, ProcedureError> {
        let base = self.primary(rest, text)?;
        match take(rest, &['^']) {
            Some(_) => Ok(binary(Binary::Power, base, self.signed(rest, text)?)),
            None => Ok(base),
        }
    }

    fn primary(&mut self, rest: &mut Rest<'a>, text: &str) -> Result<Term, ProcedureError> {
        let Some(((token, at), after)) = rest.split_first() else {
            return Err(fault("it ends too early", text.chars().count()));
        };
        *rest = after;
        self.terms += 1;
        if self.terms > MAX_TERMS {
            return Err(fault("it has too many terms", *at));
        }
        match token {
            Token::Number(value) => Ok(Term::Number(*value)),
            Token::Sign('(') => {
                let term = self.sum(rest, text)?;
                close(rest, text)?;
                Ok(term)
            }
            Token::Name(name) => self.name(name, *at, rest, text),
            Token::Sign(sign) => Err(fault(format!("{sign} was not expected"), *at)),
        }
    }

    fn name(
        &mut self,
        name: &str,
        at: usize,
        rest: &mut Rest<'a>,
        text: &str,
    ) -> Result<Term, ProcedureError> {
        if let Some(i) = self.names.iter().position(|n| *n == name) {
            return Ok(Term::Variable(i));
        }
        // A definition sees only those after it, so that none is in terms of itself.
        if let Some(i) = self.definitions.iter().position(|d| d.0 == name) {
            let all = self.definitions;
            self.definitions = &all[i + 1..];
            let term = self.whole(all[i].1, text);
            self.definitions = all;
            return term;
        }
        let call = Call::named(name)
            .ok_or_else(|| fault(format!("{name} is no parameter and no function"), at))?;
        if take(rest, &['(']).is_none() {
            return Err(fault(format!("( expected after {name}"), at));
        }
        let mut arguments = vec![self.sum(rest, text)?];
        while take(rest, &[',']).is_some() {
            arguments.push(self.sum(rest, text)?);
        }
        close(rest, text)?;
        let fits = match call {
            Call::Min | Call::Max => arguments.len() > 1,
            _ => arguments.len() == 1,
        };
        if !fits {
            let what = format!("{name} does not take {} values", arguments.len());
            return Err(fault(what, at));
        }
        Ok(Term::Call(call, arguments))
    }
}

fn binary(sign: Binary, left: Term, right: Term) -> Term {
    Term::Binary(sign, Box::new((left, right)))
}

/// The next token, if it is one of these signs.
fn take(rest: &mut Rest, signs: &[char]) -> Option<char> {
    match rest.split_first() {
        Some(((Token::Sign(sign), _), after)) if signs.contains(sign) => {
            *rest = after;
            Some(*sign)
        }
        _ => None,
    }
}

fn close(rest: &mut Rest, text: &str) -> Result<(), ProcedureError> {
    match take(rest, &[')']) {
        Some(_) => Ok(()),
        None => {
            let end = || text.chars().count();
            Err(fault(
                ") expected",
                rest.first().map_or_else(end, |(_, at)| *at),
            ))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn value(text: &str, x: f64, p: f64) -> Result<f64, ProcedureError> {
        Ok(Formula::parse(text, &["x", "p"])?.value(&[x], &[p]))
    }

    /// A named and an unnamed product, powers, signs, parts.
    #[test]
    fn formulas_have_the_values_of_arithmetic() {
        for (text, expected) in [
            ("2 x + 3p", 13.0),
            ("-x^2", -4.0),
            ("2^-x", 0.25),
            ("2^3^x", 512.0),
            ("x/p/2", 1.0 / 3.0),
            ("x (p - 1)/2", 2.0),
            ("(1-2 x)(p)", -9.0),
            ("psi = max(x, p, 1) min(x, p)", 6.0),
            ("psi = x t; t = u + 1, u = p", 8.0),
            ("psi = x·[t − 1] where t = p", 4.0),
            ("1e-1 x", 0.2),
            ("exp(ln(x))", 2.0),
            ("log10(100) + sqrt(4) + abs(-1)", 5.0),
            ("Phi(0 x)", 0.5),
        ] {
            let found = value(text, 2.0, 3.0).unwrap();
            assert!((found - expected).abs() < 1e-12, "{text}: {found}");
        }
    }

    #[test]
    fn bad_formulas_say_where() {
        for (text, place) in [
            ("x + q", "q is no parameter and no function at character 5"),
            ("(x", ") expected at character 2"),
            ("x )", "this was not expected at character 3"),
            ("exp x", "( expected after exp at character 1"),
            ("exp(x, p)", "exp does not take 2 values at character 1"),
            ("", "it ends too early at character 0"),
            ("x # p", "\"#\" has no meaning here at character 3"),
            ("psi = x; 3", "a name and = expected at character 10"),
            (
                "t; t = t",
                "t is no parameter and no function at character 8",
            ),
        ] {
            let found = value(text, 1.0, 1.0).unwrap_err().to_string();
            assert_eq!(found, format!("formula: {place}"));
        }
        assert!(value(&"(".repeat(1_500), 1.0, 1.0).is_err());
        assert!(value(&"-".repeat(1_900), 1.0, 1.0).is_err());
        assert!(value(&"x".repeat(3_000), 1.0, 1.0).is_err());
        // definitions that double what they stand for
        let doubling: Vec<String> = (0..40)
            .map(|i| format!("a{i} = a{0} a{0}", i + 1))
            .collect();
        assert!(
            value(
                &format!("psi = a0; {}; a40 = x", doubling.join(";")),
                1.0,
                1.0
            )
            .is_err()
        );
    }
}
