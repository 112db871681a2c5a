//! Warnings and caveats.

/// A warning, or a caveat of a finding.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Warning {
    /// A stable identifier for programs.
    pub code: &'static str,
    /// A sentence without capital and full stop. May contain names from the data: untrusted.
    pub text: String,
}
