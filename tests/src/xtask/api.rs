//! The public interface of massline-core: the committed list of it, and what of it nobody uses.
//!
//! The stable toolchain has no machine-readable list of a crate's items, and a comparison of versions
//! needs a published one. The pages of rustdoc hold the same: each item's declaration, its methods and
//! the traits it implements. They are written down in `core/api.txt`, so that no change of the
//! interface goes unseen.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use super::process::StepError;
use crate::readme::{ACCEPT, accepts};

/// The list, from the project's folder.
pub const LIST: &str = "core/api.txt";
/// Folder of cargo for these pages alone: others are written with other features.
pub const TARGET: &str = "target/api";
/// Most items: types, traits, functions, methods and constants; fields, variants and implemented
/// traits are not counted.
const MOST: usize = 200;
/// Folders in which an item counts as used.
const USERS: [&str; 5] = [
    "core/examples",
    "core/tests",
    "firmware",
    "host-tools",
    "tests",
];

/// The interface as text, and the names of its items.
#[derive(Debug, Default)]
pub struct Interface {
    /// One declaration a line.
    pub text: String,
    /// Last names of all that is counted.
    pub names: Vec<String>,
}

/// Reads the pages of a crate.
///
/// # Errors
///
/// [`StepError::File`] if a page is not what rustdoc writes.
pub fn read(root: &Path) -> Result<Interface, StepError> {
    let pages = root.join(TARGET).join("doc/massline_core");
    let page = |name: &str| {
        let path = pages.join(name);
        fs::read_to_string(&path).map_err(|error| StepError::file(&path, error))
    };
    let mut interface = Interface::default();
    let all = page("all.html")?;
    for entry in all.split("<li><a href=\"").skip(1) {
        let Some((file, rest)) = entry.split_once("\">") else {
            continue;
        };
        // Links to headings of the page itself come first.
        if file.starts_with('#') {
            continue;
        }
        let name = plain(rest.split("</a>").next().unwrap_or(""));
        interface.add(&name, &page(file)?);
    }
    if interface.names.is_empty() {
        let problem = "lists no item: rustdoc writes its pages in another way than it did";
        return Err(StepError::file(&pages.join("all.html"), problem));
    }
    Ok(interface)
}

impl Interface {
    /// Adds an item from its page.
    fn add(&mut self, path: &str, page: &str) {
        let last = path.rsplit("::").next().unwrap_or(path);
        self.names.push(last.to_owned());
        let declaration = between(
            page,
            "<pre class=\"rust item-decl\"><code>",
            "</code></pre>",
        );
        self.text += &format!("{path}: {}\n", plain(declaration.unwrap_or("")));
        let (own, implemented) = match page.split_once("id=\"trait-implementations\"") {
            Some((own, rest)) => (own, rest),
            None => (page, ""),
        };
        let own = own.split("id=\"implementors\"").next().unwrap_or("");
        let own = own.split("id=\"foreign-impls\"").next().unwrap_or("");
        for section in own.split("<section id=\"").skip(1) {
            let id = section.split('"').next().unwrap_or("");
            let Some((kind, name)) = id.split_once('.') else {
                continue;
            };
            if ["method", "tymethod", "associatedconstant"].contains(&kind) {
                // Of two methods of one name the second one's has a number.
                let name = name.split('-').next().unwrap_or(name);
                self.names.push(name.to_owned());
                self.text += &format!("{path}::{name}: {}\n", header(section));
            }
        }
        let explicit = implemented.split("id=\"synthetic-implementations\"").next();
        for section in explicit.unwrap_or("").split("<section id=\"impl-").skip(1) {
            self.text += &format!("{path} is: {}\n", header(section));
        }
    }

    /// Compares the interface with the list, and looks for users of its items.
    ///
    /// # Errors
    ///
    /// [`StepError::File`] that says what differs, and how a change is accepted.
    pub fn judge(&self, root: &Path) -> Result<String, StepError> {
        let list = root.join(LIST);
        if accepts() {
            fs::write(&list, &self.text).map_err(|e| StepError::file(&list, e))?;
        }
        let kept = fs::read_to_string(&list).map_err(|e| StepError::file(&list, e))?;
        let changes = changes(&kept, &self.text);
        if !changes.is_empty() {
            let problem = format!(
                "the interface of massline-core is another one:\n{changes}\
                 if this is meant, say so in CHANGELOG.md and accept it: \
                 `{ACCEPT}=1 cargo xtask test --only api`"
            );
            return Err(StepError::file(&list, problem));
        }
        let count = self.names.len();
        if count >= MOST {
            let problem = format!("{count} public items; there should be fewer than {MOST}");
            return Err(StepError::file(&list, problem));
        }
        let unused = self.unused(root)?;
        if !unused.is_empty() {
            let problem = format!(
                "used by no example, no test outside the crate, not by the firmware nor the host: {}",
                unused.join(", ")
            );
            return Err(StepError::file(&list, problem));
        }
        Ok(format!("{count} public items, each with a user"))
    }

    /// Names that no source outside of core's own has.
    fn unused(&self, root: &Path) -> Result<Vec<&str>, StepError> {
        let mut words = BTreeSet::new();
        for folder in USERS {
            words_below(&root.join(folder), &mut words)?;
        }
        let all = self.names.iter().map(String::as_str);
        let unused: BTreeSet<&str> = all.filter(|name| !words.contains(*name)).collect();
        Ok(unused.into_iter().collect())
    }
}

/// Adds the words of all sources below a folder.
fn words_below(folder: &Path, words: &mut BTreeSet<String>) -> Result<(), StepError> {
    let entries = fs::read_dir(folder).map_err(|error| StepError::file(folder, error))?;
    for entry in entries.flatten() {
        let path: PathBuf = entry.path();
        if path.is_dir() {
            words_below(&path, words)?;
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            let text = fs::read_to_string(&path).map_err(|e| StepError::file(&path, e))?;
            let all = text.split(|c: char| !c.is_alphanumeric() && c != '_');
            words.extend(all.map(str::to_owned));
        }
    }
    Ok(())
}

/// Lines of either text that the other one lacks, marked as a comparison of files marks them.
fn changes(kept: &str, found: &str) -> String {
    let marked = |mark: char, of: &str, other: &str| -> String {
        let other: BTreeSet<&str> = other.lines().collect();
        let lines = of.lines().filter(|line| !other.contains(line));
        lines.map(|line| format!("{mark} {line}\n")).collect()
    };
    marked('-', kept, found) + &marked('+', found, kept)
}

/// The text of the first header of a section.
fn header(section: &str) -> String {
    plain(between(section, "class=\"code-header\">", "</h").unwrap_or(""))
}

fn between<'t>(text: &'t str, from: &str, to: &str) -> Option<&'t str> {
    let (_, rest) = text.split_once(from)?;
    rest.split(to).next()
}

/// Text without its tags, on one line.
fn plain(html: &str) -> String {
    let mut text = String::new();
    for (number, part) in html.split('<').enumerate() {
        match part.split_once('>') {
            // Words of a button that folds what follows.
            Some((tag, rest)) if number > 0 && !tag.starts_with("span>Show") => {
                let is_button = tag.starts_with("span") && rest.starts_with("Show ");
                text += if is_button { "" } else { rest };
            }
            _ => text += part,
        }
    }
    // The sign beside a type that implements a trait worth noting, which depends on the crates that were looked at.
    let text = text.replace('ⓘ', " ");
    let words = text.split_whitespace().collect::<Vec<_>>().join(" ");
    let marks = [
        ("&lt;", "<"),
        ("&gt;", ">"),
        ("&quot;", "\""),
        ("&#39;", "'"),
        ("&amp;", "&"),
    ];
    let marks = marks.into_iter();
    marks.fold(words, |text, (from, to)| text.replace(from, to))
}

#[cfg(test)]
mod tests {
    use super::*;

    const PAGE: &str = "<pre class=\"rust item-decl\"><code>pub struct <a href=\"x\">Band</a>&lt;'a&gt; {\n\
        <details><summary class=\"hideme\"><span>Show 2 fields</span></summary>    pub low: f64,\n}</code></pre>\
        <section id=\"method.new\" class=\"method\"><h4 class=\"code-header\">pub fn <a>new</a>(low: f64) -&gt; Self <a class=\"tooltip\">ⓘ</a></h4>\
        <h2 id=\"trait-implementations\">\
        <section id=\"impl-Clone-for-Band\"><h3 class=\"code-header\">impl Clone for Band</h3>\
        <section id=\"method.clone\"><h4 class=\"code-header\">fn clone(&amp;self) -&gt; Self</h4>\
        <h2 id=\"synthetic-implementations\"><section id=\"impl-Send-for-Band\"><h3 class=\"code-header\">impl Send for Band</h3>";

    #[test]
    fn reads_a_page() {
        let mut interface = Interface::default();
        interface.add("spectra::Band", PAGE);
        assert_eq!(
            interface.text,
            "spectra::Band: pub struct Band<'a> { pub low: f64, }\n\
             spectra::Band::new: pub fn new(low: f64) -> Self\n\
             spectra::Band is: impl Clone for Band\n"
        );
        assert_eq!(interface.names, ["Band", "new"]);
    }

    #[test]
    fn tells_what_has_changed() {
        assert_eq!(changes("a\nb\nc\n", "a\nd\nc\n"), "- b\n+ d\n");
        assert_eq!(changes("a\n", "a\n"), "");
    }
}
