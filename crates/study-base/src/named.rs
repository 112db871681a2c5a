//! Enumerations whose values have names in files and arguments.

/// Declares an enumeration, and `as_str` with the name of each value.
///
/// ```
/// study_base::named! {
///     /// Initial state of a recursion.
///     Start {
///         /// From zero.
///         Cold = "cold",
///         /// From earlier samples.
///         Warm = "warm",
///     }
/// }
/// assert_eq!(Start::Warm.as_str(), "warm");
/// ```
#[macro_export]
macro_rules! named {
    ($(#[$meta:meta])* $name:ident { $($(#[$what:meta])* $value:ident = $text:literal,)+ }) => {
        $(#[$meta])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        pub enum $name {
            $($(#[$what])* $value,)+
        }

        impl $name {
            /// The name in files and arguments.
            pub fn as_str(self) -> &'static str {
                match self {
                    $(Self::$value => $text,)+
                }
            }
        }
    };
}
