//! Blocks, prose, headings and links of a page.

use crate::support::repository;
use std::fs;

/// A fenced block.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Block {
    /// The line of its fence, from 1.
    pub line: usize,
    /// The words after the fence: a language, and what else the page says of the block.
    pub words: Vec<String>,
    /// Its lines.
    pub lines: Vec<String>,
}

impl Block {
    pub fn language(&self) -> &str {
        self.words.first().map_or("", String::as_str)
    }

    pub fn is(&self, word: &str) -> bool {
        self.words.iter().skip(1).any(|w| w == word)
    }

    /// The value of `key=value` after the fence.
    pub fn value(&self, key: &str) -> Option<&str> {
        let mut words = self.words.iter();
        words.find_map(|word| word.strip_prefix(key)?.strip_prefix('='))
    }
}

/// A page, apart from each other: its blocks and the lines of its text with their numbers.
#[derive(Debug, Default)]
pub struct Page {
    /// Path in the repository.
    pub path: String,
    pub blocks: Vec<Block>,
    pub prose: Vec<(usize, String)>,
}

/// Reads a page of the repository.
pub fn page(path: &str) -> Page {
    let text = fs::read_to_string(repository(path)).unwrap_or_else(|e| panic!("{path}: {e}"));
    parse(path, &text)
}

/// Takes a page apart. A block may be indented, such as in a list.
pub fn parse(path: &str, text: &str) -> Page {
    let mut page = Page {
        path: path.to_owned(),
        ..Page::default()
    };
    let mut open: Option<(usize, Block)> = None;
    for (i, line) in text.lines().enumerate() {
        let inner = line.trim_start();
        let indent = line.len() - inner.len();
        match (&mut open, inner.strip_prefix("```")) {
            (None, Some(words)) => {
                let words = words.split(',').map(|word| word.trim().to_owned());
                let block = Block {
                    line: i + 1,
                    words: words.collect(),
                    lines: Vec::new(),
                };
                open = Some((indent, block));
            }
            (None, None) => page.prose.push((i + 1, line.to_owned())),
            (Some(_), Some("")) => page.blocks.extend(open.take().map(|(_, block)| block)),
            (Some((indent, block)), _) => {
                let cut = line.len().min(*indent);
                block.lines.push(line[cut..].to_owned());
            }
        }
    }
    assert!(open.is_none(), "{path}: a block does not end: {open:?}");
    page
}

/// A line of text without its `code`, which has no links.
pub fn without_code(line: &str) -> String {
    line.split('`').step_by(2).collect::<Vec<_>>().join(" ")
}

/// The spans of `code` of a line.
pub fn code(line: &str) -> impl Iterator<Item = &str> {
    line.split('`').skip(1).step_by(2)
}

/// The targets of the links and pictures of a page, with their lines.
pub fn links(page: &Page) -> Vec<(usize, String)> {
    let of = |(number, line): &(usize, String)| {
        let line = without_code(line);
        let parts = line.split("](").skip(1);
        let targets = parts.filter_map(|rest| Some(rest.split_once(')')?.0.to_owned()));
        let number = *number;
        targets.map(move |t| (number, t)).collect::<Vec<_>>()
    };
    page.prose.iter().flat_map(of).collect()
}

/// The anchors of the headings of a page, as GitHub and mdBook make them.
pub fn anchors(page: &Page) -> Vec<String> {
    let mut found: Vec<String> = Vec::new();
    for (_, line) in &page.prose {
        let Some(title) = line.strip_prefix('#') else {
            continue;
        };
        let title = title.trim_start_matches('#').trim().to_lowercase();
        let kept = title.chars().filter_map(|c| match c {
            ' ' => Some('-'),
            c if c.is_alphanumeric() || c == '-' || c == '_' => Some(c),
            _ => None,
        });
        let anchor: String = kept.collect();
        let before = found.iter().filter(|a| **a == anchor).count();
        found.push(match before {
            0 => anchor,
            n => format!("{anchor}-{n}"),
        });
    }
    found
}

#[test]
fn a_page_is_taken_apart() {
    let text = "# A title, here\n`[x](y)` [a](b.md#c)\n\n1. first\n   ```console,fails\n   $ ls\n     x\n   ```\n```csv,save=t.csv\na,b\n```\n## A title, here\n";
    let page = parse("p.md", text);
    assert_eq!(page.blocks.len(), 2);
    assert_eq!(page.blocks[0].lines, ["$ ls", "  x"]);
    assert!(page.blocks[0].is("fails") && page.blocks[0].language() == "console");
    assert_eq!(page.blocks[0].line, 5);
    assert_eq!(page.blocks[1].value("save"), Some("t.csv"));
    assert_eq!(links(&page), [(2, "b.md#c".to_owned())]);
    assert_eq!(anchors(&page), ["a-title-here", "a-title-here-1"]);
    assert_eq!(code("a `0.5` b `c`").collect::<Vec<_>>(), ["0.5", "c"]);
}
