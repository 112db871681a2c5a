//! Protocols that were damaged at random.

use super::*;
use proptest::prelude::*;

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn a_damaged_protocol_never_panics(at in 0..LEAST.len(), with in "\\PC{0,3}|[\\[\\]{}=\",.0-9-]{1,4}") {
        let mut at = at;
        while !LEAST.is_char_boundary(at) {
            at -= 1;
        }
        let text = format!("{}{with}{}", &LEAST[..at], &LEAST[at..]);
        let parsed = parse("p", &text);
        prop_assert_eq!(parsed.protocol.is_none(), parsed.findings.has_errors());
        parsed.findings.render(false);
    }
}
