//! Check of the licences and origins of dependencies.
//!
//! The configuration of `cargo deny` lists the allowed ones, so that both checks agree. `cargo
//! deny` itself takes minutes to build, too long for a fresh machine; it checks advisories where it
//! is installed.

use std::collections::BTreeSet;
use std::fmt::Write;

use spdx::{Expression, ParseMode};

/// The configuration, from the top of the workspace.
pub const CONFIGURATION: &str = ".cargo/deny.toml";

/// The arguments of `cargo` that list all packages for all targets, as [`check`] reads them.
pub const LISTING: [&str; 10] = [
    "tree",
    "--workspace",
    "--locked",
    "--all-features",
    "--target=all",
    "--edges=normal,build,dev",
    "--prefix=none",
    "--charset=ascii",
    "--color=never",
    "--format={l}\t{p}",
];

/// Allowed licences and their exceptions.
#[derive(Debug, Default, PartialEq, Eq)]
pub struct Allowed {
    licences: Vec<String>,
    /// Crates and a licence that is allowed for them alone.
    exceptions: Vec<(String, String)>,
}

impl Allowed {
    /// Reads the section `[licenses]` of the configuration; `None` if it allows no licence.
    pub fn read(configuration: &str) -> Option<Self> {
        let mut allowed = Self::default();
        let mut section = String::new();
        for line in configuration.lines() {
            // No licence and no crate has a `#` in its name.
            let line = line.split('#').next().unwrap_or_default().trim();
            match line
                .strip_prefix('[')
                .and_then(|rest| rest.strip_suffix(']'))
            {
                Some(name) if !name.contains('"') => section = name.trim().to_owned(),
                _ if section == "licenses" => allowed.line(line),
                _ => {}
            }
        }
        (!allowed.licences.is_empty()).then_some(allowed)
    }

    /// Adds the licences of a line, or an exception, which is a table in one line.
    fn line(&mut self, line: &str) {
        let quoted = |text: &str| -> Vec<String> {
            let parts = text.split('"').skip(1).step_by(2);
            parts.map(str::to_owned).collect()
        };
        let Some((_, table)) = line.split_once('{') else {
            self.licences.extend(quoted(line));
            return;
        };
        let (licences, name) = match table.split_once("crate") {
            Some((licences, name)) if licences.contains("allow") => (licences, name),
            _ => return,
        };
        if let Some(name) = quoted(name).first() {
            let licences = quoted(licences).into_iter();
            self.exceptions
                .extend(licences.map(|licence| (name.clone(), licence)));
        }
    }

    fn contains(&self, licence: &str, package: &str) -> bool {
        self.licences.iter().any(|allowed| allowed == licence)
            || self
                .exceptions
                .iter()
                .any(|(name, allowed)| name == package && allowed == licence)
    }
}

/// Checks a listing of packages and returns their number.
///
/// # Errors
///
/// A line for each package that is not allowed, with its name and version.
pub fn check(listing: &str, allowed: &Allowed) -> Result<usize, String> {
    let mut packages = BTreeSet::new();
    let mut findings = BTreeSet::new();
    for line in listing.lines().filter(|line| !line.trim().is_empty()) {
        let Some((licence, package)) = line.split_once('\t') else {
            findings.insert(format!("{line:?} is no line of a listing"));
            continue;
        };
        let mut words = package.split_whitespace();
        let (name, version) = (words.next().unwrap_or_default(), words.next());
        let title = format!("{name} {}", version.unwrap_or_default());
        if licence.is_empty() {
            findings.insert(format!("{title} names no licence"));
        } else {
            match satisfied(licence, |one| allowed.contains(one, name)) {
                Some(true) => {}
                Some(false) => {
                    findings.insert(format!("{title} is under {licence}"));
                }
                None => {
                    findings.insert(format!(
                        "{title} has a licence that cannot be read: {licence:?}"
                    ));
                }
            }
        }
        // A local package has a folder in this place, a repository an address.
        if let Some(origin) = words.find(|word| word.contains("://")) {
            findings.insert(format!(
                "{title} is not from the registry but from {origin}"
            ));
        }
        packages.insert(title);
    }
    if packages.is_empty() {
        return Err("cargo has listed no package".to_owned());
    }
    if findings.is_empty() {
        return Ok(packages.len());
    }
    let mut text = String::new();
    for finding in findings {
        let _ = writeln!(text, "{finding}");
    }
    Err(text)
}

/// `true` if a licence expression has an alternative of which every part is allowed; `None` if it
/// is no expression.
fn satisfied(expression: &str, allowed: impl Fn(&str) -> bool) -> Option<bool> {
    // Lax for the older expressions of cargo, with `/` for `OR`.
    let expression = Expression::parse_mode(expression, ParseMode::LAX).ok()?;
    Some(expression.evaluate(|licence| allowed(&licence.to_string())))
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "[graph]\nall-features = true\nallow = [\"GPL-3.0-only\"]\n\
        [licenses]\n# \"Zlib\" was here\nallow = [\n  \"MIT\", # short\n  \"Apache-2.0\",\n]\n\
        exceptions = [\n  { allow = [\"MPL-2.0\"], crate = \"serialport\" },\n]\n\
        [sources]\nunknown-git = \"deny\"\n";

    #[test]
    fn reads_its_own_section_only() {
        let allowed = Allowed::read(TEXT).unwrap();
        assert_eq!(allowed.licences, ["MIT", "Apache-2.0"]);
        assert_eq!(
            allowed.exceptions,
            [("serialport".to_owned(), "MPL-2.0".to_owned())]
        );
        let line = Allowed::read("[licenses]\nallow = [\"MIT\", \"0BSD\"]").unwrap();
        assert_eq!(line.licences, ["MIT", "0BSD"]);
        assert_eq!(Allowed::read("[bans]\nallow = [\"MIT\"]"), None);
        assert_eq!(Allowed::read(""), None);
    }

    #[test]
    fn the_projects_configuration_allows_something() {
        let allowed = Allowed::read(include_str!("../../../.cargo/deny.toml")).unwrap();
        assert!(allowed.contains("MIT", "anything"));
        assert!(!allowed.contains("deny", "anything"));
        assert!(allowed.contains("MPL-2.0", "serialport"));
        assert!(!allowed.contains("MPL-2.0", "anything"));
    }

    #[test]
    fn an_expression_is_satisfied_by_a_choice_with_all_its_parts() {
        let value = |expression| satisfied(expression, |one| ["MIT", "BSL-1.0"].contains(&one));
        for (expression, expected) in [
            ("MIT", Some(true)),
            ("GPL-3.0-only", Some(false)),
            ("MIT OR GPL-3.0-only", Some(true)),
            ("MIT/Apache-2.0", Some(true)),
            ("Apache-2.0 / MIT", Some(true)),
            ("MIT AND GPL-3.0-only", Some(false)),
            // AND binds closer.
            ("MIT OR GPL-3.0-only AND Zlib", Some(true)),
            ("(MIT OR GPL-3.0-only) AND Zlib", Some(false)),
            ("(MIT OR Zlib) AND (Zlib OR BSL-1.0)", Some(true)),
            ("MIT WITH LLVM-exception", Some(false)),
            ("", None),
            ("MIT OR", None),
            ("(MIT", None),
            ("MIT)", None),
            ("MIT Zlib", None),
            ("OR", None),
        ] {
            assert_eq!(value(expression), expected, "{expression}");
        }
    }

    #[test]
    fn every_package_that_is_not_allowed_is_named() {
        let allowed = Allowed::read(TEXT).unwrap();
        let good = "MIT OR Zlib\ta v1.0.0\n\nMIT OR Zlib\ta v1.0.0 (*)\nMIT\tb v2.0.0 (/b)\n\
            MPL-2.0\tserialport v4.0.0\n";
        assert_eq!(check(good, &allowed), Ok(3));
        let bad = "MPL-2.0\tc v1.0.0\n\td v1.0.0\nMIT OR\te v1.0.0\n\
            MIT\tf v1.0.0 (https://host/f#0123)\nnoise\n";
        let findings = check(&format!("{good}{bad}"), &allowed).unwrap_err();
        assert_eq!(
            findings.lines().collect::<Vec<_>>(),
            [
                "\"noise\" is no line of a listing",
                "c v1.0.0 is under MPL-2.0",
                "d v1.0.0 names no licence",
                "e v1.0.0 has a licence that cannot be read: \"MIT OR\"",
                "f v1.0.0 is not from the registry but from (https://host/f#0123)",
            ]
        );
        assert!(check("", &allowed).is_err());
    }
}
