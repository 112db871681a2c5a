//! The terminal, and the participant's page.

use super::finding::{About, Finding, Fit, Use};
use super::{Page, Terminal};

/// Uses in which somebody sits at the terminal.
const AT_TERMINAL: [Use; 3] = Use::SESSIONS;

/// Everything about the terminal.
pub(super) fn terminal(terminal: &Terminal) -> Vec<Finding> {
    let of = |id, fit, says| Finding::new(About::Terminal, id, &AT_TERMINAL, fit, says);
    if !terminal.input || !terminal.output {
        let which = match (terminal.input, terminal.output) {
            (false, false) => "Neither standard input nor standard output is a terminal",
            (false, true) => "Standard input is no terminal",
            _ => "Standard output is no terminal",
        };
        let says = format!("{which}, so that nothing is known of the one that sessions will have.");
        return vec![of("terminal", Fit::WithLimits, says).advice(
            "Run `study doctor` in the terminal of the sessions; without one they need `--plain`.",
        )];
    }
    let [columns, rows] = terminal.least;
    let mut findings = Vec::new();
    if terminal.plain {
        let says = "The environment asks for lines (STUDY_PLAIN or TERM=dumb): sessions are as with `--plain`.";
        findings.push(of("lines", Fit::Fit, says.to_owned()));
    } else if !terminal.positions {
        let says = "The terminal cannot position text, so that it shows no page.".to_owned();
        findings.push(
            of("position", Fit::WithLimits, says)
                .advice("Use another terminal, set TERM to its real name, or use `--plain`."),
        );
    }
    findings.push(match terminal.size {
        Some([w, h]) if w < columns || h < rows => {
            let says =
                format!("The terminal has {w} × {h} cells, and a page needs {columns} × {rows}.");
            of("size", Fit::WithLimits, says).advice("Enlarge the window, or use `--plain`.")
        }
        Some([w, h]) => {
            let says =
                format!("The terminal has {w} × {h} cells; a page needs {columns} × {rows}.");
            of("size", Fit::Fit, says)
        }
        None => of(
            "size",
            Fit::WithLimits,
            "The terminal does not tell its size.".to_owned(),
        )
        .advice("Use another terminal, or `--plain`."),
    });
    if terminal.utf8 == Some(false) {
        let says = "The environment does not say that the terminal shows UTF-8 (LC_ALL, LC_CTYPE, LANG), and frames and umlauts may be wrong.";
        findings.push(
            of("utf-8", Fit::WithLimits, says.to_owned())
                .advice("Set LANG, such as to C.UTF-8, or use `--plain`."),
        );
    }
    let colors = match (terminal.colors, terminal.no_color) {
        (_, true) => "No colors, as NO_COLOR asks; no page depends on them.".to_owned(),
        (0, _) => "The terminal shows no colors; no page depends on them.".to_owned(),
        (n, _) => format!("{n} colors."),
    };
    findings.push(of("colors", Fit::Fit, colors));
    findings
}

/// The participant's page.
pub(super) fn page(page: &Page) -> Finding {
    let of = |fit, says| Finding::new(About::Page, "page", &[Use::Tablet], fit, says);
    match (&page.address, &page.failure) {
        (_, Some(why)) => of(
            Fit::NotFit,
            format!("The participant's page cannot be served: {why}."),
        )
        .advice("Run sessions without --screen, or correct what is named."),
        (None, None) => {
            let says = "This computer has no address in a network: only a browser on itself reaches the page (`study run --screen`).";
            of(Fit::NotFit, says.to_owned())
                .advice("Connect it to the network of the tablet, if one is to be used.")
        }
        (Some(address), None) => of(
            Fit::Fit,
            format!(
                "The page was served at {address} (`study run --screen={address}`); whether the network and a firewall let a tablet through was not measured."
            ),
        ),
    }
}
