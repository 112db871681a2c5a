//! A program and its arguments in one argument, as a shell reads them.

use super::Failure;

/// Splits a command at spaces; quotes keep words together.
///
/// On Windows a backslash separates folders and quotes nothing.
///
/// # Errors
/// [`Failure`] for a quote that is not closed, and a command without a program.
pub(super) fn words(option: &str, command: &str) -> Result<Vec<String>, Failure> {
    let text = match cfg!(windows) {
        true => command.replace('\\', r"\\"),
        false => command.to_owned(),
    };
    let words = shell_words::split(&text).map_err(|_| {
        Failure::usage(format!("{option}: a quote is not closed")).hint(format!(
            "{option} \"PROGRAM 'an argument with spaces' …\", quoted as for a shell"
        ))
    })?;
    match words.is_empty() {
        true => Err(Failure::usage(format!("{option} names no program"))
            .hint(format!("{option} \"PROGRAM ARGUMENTS\""))),
        false => Ok(words),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quotes_keep_words_together() {
        for (command, expected) in [
            ("python3  a.py", vec!["python3", "a.py"]),
            ("a 'b c' \"d e\"", vec!["a", "b c", "d e"]),
            (
                "'/home/an a/bin/x' --k='1 2'",
                vec!["/home/an a/bin/x", "--k=1 2"],
            ),
            ("a ''", vec!["a", ""]),
        ] {
            assert_eq!(words("--command", command).unwrap(), expected, "{command}");
        }
        for command in ["a 'b", "a \"b", "'"] {
            let failure = words("--command", command).unwrap_err();
            assert!(
                failure.message.contains("not closed"),
                "{}",
                failure.message
            );
        }
        assert!(
            words("--front", "  ")
                .unwrap_err()
                .message
                .contains("no program")
        );
    }
}
