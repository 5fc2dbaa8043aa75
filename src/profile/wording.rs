//! Complaints of the TOML reader in the words of a person who writes a config, not of one who writes Rust.

/// Types of Rust and what they are to a reader; the first that the name begins with.
const TYPES: [(&str, &str); 13] = [
    ("usize", "a whole number, 0 or more"),
    ("u64", "a whole number, 0 or more"),
    ("u32", "a whole number, 0 or more"),
    ("u8", "a whole number from 0 to 255"),
    ("i64", "a whole number"),
    ("i32", "a whole number"),
    ("f64", "a number"),
    ("a sequence", "a list in brackets, like [1, 2]"),
    ("a string", "a text in quotes"),
    ("string or table", "a text in quotes or a table"),
    ("a boolean", "true or false"),
    ("a map", "a table"),
    ("struct ", "a table"),
];
/// What was found instead.
const FOUND: [(&str, &str); 5] =
    [("string ", ""), ("integer ", ""), ("floating point ", ""), ("boolean ", ""), ("sequence", "a list")];
/// How alike a word must be to be meant.
const ALIKE: f64 = 0.8;

/// A message of serde or TOML, reworded where it speaks of Rust; others as they are.
pub fn plain(message: &str) -> String {
    for kind in ["invalid type: ", "invalid value: "] {
        if let Some((found, expected)) = message.strip_prefix(kind).and_then(|it| it.split_once(", expected ")) {
            return format!("must be {}, not {}", wanted(expected), given(found));
        }
    }
    if let Some((found, expected)) = message.strip_prefix("invalid length ").and_then(|it| it.split_once(", expected "))
    {
        let wanted = expected.strip_prefix("an array of length ").map(|it| format!("a list of {it}"));
        return format!("must be {}, not a list of {found}", wanted.unwrap_or_else(|| expected.to_owned()));
    }
    for (kind, noun) in [("unknown field ", "key"), ("unknown variant ", "value")] {
        if let Some((word, known)) = message.strip_prefix(kind).and_then(|it| it.split_once(", ")) {
            let known = known.strip_prefix("expected ").unwrap_or(known);
            let names = known.strip_prefix("one of ").unwrap_or(known);
            return format!("unknown {noun} {word}{}; there are {names}", meant(word, names));
        }
    }
    match message.strip_prefix("missing field ") {
        Some(name) => format!("the key {name} is missing"),
        None => message.to_owned(),
    }
}

fn wanted(expected: &str) -> &str {
    TYPES.iter().find(|it| expected.starts_with(it.0)).map_or(expected, |it| it.1)
}

fn given(found: &str) -> String {
    let value = |it: &(&str, &str)| found.strip_prefix(it.0).map(|rest| format!("{}{}", it.1, rest.replace('`', "")));
    FOUND.iter().find_map(value).unwrap_or_else(|| if found == "map" { "a table".into() } else { found.to_owned() })
}

/// The known word in backticks that is most like a word, if one is.
fn meant(word: &str, names: &str) -> String {
    let word = word.trim_matches('`');
    let likeness = |it: &&str| strsim::jaro_winkler(word, it);
    let best = names.split('`').skip(1).step_by(2).max_by(|a, b| likeness(a).total_cmp(&likeness(b)));
    best.filter(|it| likeness(it) >= ALIKE).map_or_else(String::new, |it| format!(" (did you mean `{it}`?)"))
}

#[cfg(test)]
mod tests {
    use super::plain;

    #[test]
    fn messages_speak_of_what_is_written_in_a_config() {
        for (raw, told) in [
            ("invalid type: string \"many\", expected usize", "must be a whole number, 0 or more, not \"many\""),
            ("invalid value: integer `-3`, expected usize", "must be a whole number, 0 or more, not -3"),
            ("invalid type: floating point `2.5`, expected u64", "must be a whole number, 0 or more, not 2.5"),
            ("invalid type: string \"B\", expected a sequence", "must be a list in brackets, like [1, 2], not \"B\""),
            ("invalid type: map, expected f64", "must be a number, not a table"),
            ("invalid length 2, expected an array of length 3", "must be a list of 3, not a list of 2"),
            (
                "unknown field `strech`, expected one of `tolerance`, `stretch`",
                "unknown key `strech` (did you mean `stretch`?); there are `tolerance`, `stretch`",
            ),
            ("unknown variant `x`, expected `few` or `some`", "unknown value `x`; there are `few` or `some`"),
            ("missing field `mesh`", "the key `mesh` is missing"),
            ("key with no value, expected `=`", "key with no value, expected `=`"),
        ] {
            assert_eq!(plain(raw), told);
        }
    }
}
