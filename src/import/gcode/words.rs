//! Lines of G-code taken apart into words.
/// Why a line cannot be read.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum LineError {
    /// Not letter and number.
    #[error("`{0}` is not a word of G-code (a letter and a number)")]
    Word(String),
    /// Variables, expressions, subprograms.
    #[error("variables, expressions and subprograms (`{0}`) are not understood; write the program without them")]
    Macro(char),
    /// An arc without a centre, or whose radius does not reach.
    #[error("this arc cannot be drawn: {0}")]
    Arc(String),
    /// A number that is not finite or a negative feed.
    #[error("`{0}` is out of range")]
    Range(String),
}

/// Letter (upper case) and number.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Word {
    /// Upper-case letter.
    pub(super) letter: u8,
    /// Its number.
    pub(super) value: f64,
}

/// A line without its comments and blanks, in upper case; the form that is sent.
pub fn bare(line: &str) -> String {
    let mut out = String::with_capacity(line.len());
    let mut depth = 0_u32;
    for c in line.chars() {
        match c {
            ';' if depth == 0 => break,
            '(' => depth += 1,
            ')' => depth = depth.saturating_sub(1),
            _ if depth > 0 || c.is_whitespace() || c.is_control() || c == '\u{feff}' => {}
            _ => out.push(c.to_ascii_uppercase()),
        }
    }
    // A lone % marks the ends of a tape; boards answer it with an error.
    if out.bytes().all(|it| it == b'%') {
        out.clear();
    }
    out
}

/// The text of a line's first comment.
pub fn comment(line: &str) -> Option<&str> {
    let at = line.find(['(', ';'])?;
    let text = &line[at + 1..];
    let text = if line.as_bytes()[at] == b'(' { text.split(')').next().unwrap_or(text) } else { text };
    Some(text.trim()).filter(|it| !it.is_empty())
}

/// Splits a bare line into words. A leading `/` (block delete), line number and checksum are dropped.
pub(super) fn words(bare: &str) -> Result<Vec<Word>, LineError> {
    let text = bare.trim_start_matches('/');
    let text = text.split('*').next().unwrap_or(text);
    let mut out = Vec::new();
    let bytes = text.as_bytes();
    let mut at = 0;
    while at < bytes.len() {
        let letter = bytes[at];
        if matches!(letter, b'#' | b'[' | b'=' | b'O') {
            return Err(LineError::Macro(letter as char));
        }
        let end = bytes[at + 1..].iter().position(|it| !matches!(it, b'0'..=b'9' | b'.' | b'-' | b'+'));
        let end = end.map_or(bytes.len(), |it| at + 1 + it);
        let number = text.get(at + 1..end).and_then(|it| it.parse::<f64>().ok());
        match number {
            Some(value) if letter.is_ascii_uppercase() => {
                if letter != b'N' {
                    out.push(Word { letter, value });
                }
            }
            _ if matches!(bytes.get(end), Some(b'#' | b'[')) => return Err(LineError::Macro(bytes[end] as char)),
            _ => {
                let end = (end..=text.len()).find(|&it| text.is_char_boundary(it)).unwrap_or(text.len());
                let start = (0..=at).rev().find(|&it| text.is_char_boundary(it)).unwrap_or(0);
                return Err(LineError::Word(text[start..end].to_owned()));
            }
        }
        at = end;
    }
    Ok(out)
}

/// Number of a G or M word in tenths: G91.1 is 911. 9999 where it is no such number.
pub(super) fn code(word: &Word) -> u32 {
    let tenths = (word.value * 10.0).round();
    if (0.0..9999.0).contains(&tenths) { tenths as u32 } else { 9999 }
}

/// G words that are carried out, in tenths. Those that end where it is not known (probing, splines, canned cycles) belong
/// here as well: they say so themselves.
const KNOWN_G: &[u32] = &[
    0, 10, 20, 30, 40, 50, 51, 52, 100, 170, 180, 190, 200, 210, 280, 281, 300, 301, 382, 383, 384, 385, 400, 431, 490,
    530, 540, 550, 560, 570, 580, 590, 610, 640, 730, 760, 800, 810, 820, 830, 840, 850, 860, 870, 880, 890, 900, 910,
    911, 920, 921, 930, 940,
];
/// M words that are carried out or change nothing that moves, in tenths.
const KNOWN_M: &[u32] = &[0, 10, 20, 30, 40, 50, 60, 70, 80, 90, 300, 600, 2800, 4000];

/// Whether a word means something here.
pub(super) fn known(word: &Word) -> bool {
    match word.letter {
        b'G' => KNOWN_G.contains(&code(word)),
        b'M' => KNOWN_M.contains(&code(word)),
        other => b"XYZABCIJKRPLSFT".contains(&other),
    }
}
