//! The faults of a protocol and the certificates of its tables: `check [PROTOCOL]`.
#![allow(clippy::print_stdout, reason = "an example prints")]

use study_analysis::check::Checked;

fn main() {
    let given = std::env::args().nth(1);
    let checked = Checked::open(given.as_deref().unwrap_or("protocols/turn-signal").as_ref());
    for findings in &checked.findings {
        print!("{}", findings.render(false));
    }
    for certified in checked.report().certificates {
        println!("{}: {}", certified.model, certified.certificate);
    }
}
