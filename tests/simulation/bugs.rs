//! Bugs that are planted in what surrounds the program, to show that the checks find them.

/// A planted bug. None of them changes the program: a wrapper of the disk, of the device, of the
/// clocks or of the participant's page does something else than it says.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Bug {
    /// A sync of a journal does nothing.
    MissingSync,
    /// What a sync of a journal is to write is on the medium only before the next write.
    LateSync,
    /// The page says "saved" when a reply has arrived.
    EarlySaved,
    /// The page sends the answers to the last question once more to the next one.
    DoubledAnswer,
    /// The page sends another rating than the one that was chosen.
    OtherRating,
    /// The page drops every Stop.
    LostStop,
    /// The device ignores that it is to go limp.
    DeafDevice,
    /// The heartbeats go on while the session's loop stands still.
    Unsupervised,
    /// No clock shows that the computer was suspended.
    HiddenSuspension,
}

impl Bug {
    pub(crate) const ALL: [Self; 9] = [
        Self::MissingSync,
        Self::LateSync,
        Self::EarlySaved,
        Self::DoubledAnswer,
        Self::OtherRating,
        Self::LostStop,
        Self::DeafDevice,
        Self::Unsupervised,
        Self::HiddenSuspension,
    ];
}
