//! The pages whose commands are run.

use crate::book::all_pages;
use crate::markdown::page;
use crate::steps::Shell;

/// One test for each page, and the list of them.
macro_rules! followed {
    ($($name:ident: $path:literal,)*) => {
        const FOLLOWED: &[&str] = &[$($path),*];
        $(
            #[test]
            fn $name() {
                Shell::new().follow(&page($path));
            }
        )*
    };
}

followed! {
    readme: "README.md",
    a_first_analysis: "docs/tutorial-csv.md",
    a_threshold: "docs/tutorial-threshold.md",
    a_first_device: "docs/tutorial-device.md",
    installation: "docs/howto-install.md",
    import_of_tables: "docs/howto-import.md",
    a_running_study: "docs/howto-running-study.md",
}

#[test]
fn every_page_with_commands_to_run_is_followed() {
    for path in all_pages() {
        let has = page(&path).blocks.iter().any(|b| b.language() == "console");
        let own = [crate::first_study::PAGE, crate::recording::PAGE];
        let is = own
            .into_iter()
            .chain(FOLLOWED.iter().copied())
            .any(|p| p == path);
        assert_eq!(has, is, "{path}");
    }
}

/// What a reader of a tutorial or a how-to guide can type, a test has typed.
#[test]
fn tutorials_have_no_command_that_is_not_run() {
    for path in all_pages() {
        let page = page(&path);
        let typed = page.blocks.iter().filter(|b| b.language() == "sh").count();
        assert!(
            typed == 0 || !path.contains("/tutorial-"),
            "{path}: commands in `sh` are not run"
        );
    }
}
