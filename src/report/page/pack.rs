//! The binary part of the page: streams of numbers one behind the other, deflated once and written in base64.
//!
//! A stream is one of three: `bytes` as they are; `integers`, each as the difference to the one before, zigzag, LEB128; `shorts`,
//! rows of unsigned 16-bit numbers, stored column by column as differences to the row before modulo 2^16, zigzag, first all low
//! bytes of the column, then all high bytes. Equal streams are stored once. `payload.js` reads them.
use std::{collections::BTreeMap, io::Write};

use flate2::{Compression, write::ZlibEncoder};
use serde_json::{Value, json};

/// Streams being put together.
#[derive(Default)]
pub(super) struct Pack {
    bytes: Vec<u8>,
    known: BTreeMap<[u8; 32], usize>,
}

impl Pack {
    /// Bytes as they are. The result is the address that the page reads them by.
    pub(super) fn bytes(&mut self, bytes: &[u8]) -> Value {
        self.add(bytes, bytes.len())
    }

    /// Whole numbers.
    pub(super) fn integers(&mut self, values: impl IntoIterator<Item = u32>) -> Value {
        let mut encoded = Vec::new();
        let mut before = 0_i64;
        let mut count = 0;
        for value in values {
            let step = i64::from(value) - before;
            before = i64::from(value);
            let mut rest = ((step << 1) ^ (step >> 63)) as u64;
            while rest >= 0x80 {
                encoded.push(rest as u8 | 0x80);
                rest >>= 7;
            }
            encoded.push(rest as u8);
            count += 1;
        }
        self.add(&encoded, count)
    }

    /// Rows of 16-bit numbers.
    pub(super) fn shorts<const D: usize>(&mut self, rows: &[[u16; D]]) -> Value {
        let mut encoded = Vec::with_capacity(2 * D * rows.len());
        for column in 0..D {
            let mut before = 0_u16;
            let steps: Vec<u16> = rows
                .iter()
                .map(|row| {
                    let step = row[column].wrapping_sub(before) as i16;
                    before = row[column];
                    ((step << 1) ^ (step >> 15)) as u16
                })
                .collect();
            encoded.extend(steps.iter().map(|it| *it as u8));
            encoded.extend(steps.iter().map(|it| (it >> 8) as u8));
        }
        self.add(&encoded, rows.len())
    }

    fn add(&mut self, encoded: &[u8], count: usize) -> Value {
        let at = *self.known.entry(*blake3::hash(encoded).as_bytes()).or_insert(self.bytes.len());
        if at == self.bytes.len() {
            self.bytes.extend_from_slice(encoded);
        }
        json!({ "at": at, "n": count })
    }

    /// All streams as text.
    pub(super) fn finish(self) -> String {
        let mut encoder = ZlibEncoder::new(Vec::new(), Compression::best());
        let deflated = encoder.write_all(&self.bytes).and_then(|()| encoder.finish());
        base64(&deflated.expect("writing to memory cannot fail"))
    }
}

/// Base64 with padding (RFC 4648, section 4).
pub(super) fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut out = String::with_capacity(4 * bytes.len().div_ceil(3));
    for group in bytes.chunks(3) {
        let byte = |i: usize| u32::from(group.get(i).copied().unwrap_or(0));
        let word = byte(0) << 16 | byte(1) << 8 | byte(2);
        for digit in 0..4 {
            let value = (word >> (18 - 6 * digit)) & 63;
            out.push(if digit <= group.len() { char::from(DIGITS[value as usize]) } else { '=' });
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use std::io::Read;

    use flate2::read::ZlibDecoder;

    use super::*;

    #[test]
    fn base64_is_that_of_the_standard() {
        // RFC 4648, section 10.
        let words = ["", "f", "fo", "foo", "foob", "fooba", "foobar"];
        let texts = ["", "Zg==", "Zm8=", "Zm9v", "Zm9vYg==", "Zm9vYmE=", "Zm9vYmFy"];
        assert_eq!(words.map(|it| base64(it.as_bytes())), texts);
    }

    #[test]
    fn streams_come_back() {
        let integers = [5, 0, u32::MAX, 7, 7];
        let rows = [[1_u16, 65_535], [0, 0], [40_000, 3]];
        let mut pack = Pack::default();
        let [a, b] = [pack.integers(integers), pack.shorts(&rows)];
        assert_eq!(pack.integers(integers), a, "equal streams are stored once");
        assert_eq!((a["n"].as_u64(), b["n"].as_u64()), (Some(5), Some(3)));
        let bytes = pack.bytes.clone();
        let mut at = a["at"].as_u64().unwrap() as usize;
        let mut before = 0_i64;
        for expected in integers {
            let (mut rest, mut shift) = (0_u64, 0);
            loop {
                rest |= u64::from(bytes[at] & 0x7f) << shift;
                shift += 7;
                at += 1;
                if bytes[at - 1] < 0x80 {
                    break;
                }
            }
            before += (rest >> 1) as i64 ^ -((rest & 1) as i64);
            assert_eq!(before, i64::from(expected));
        }
        assert_eq!(at, b["at"].as_u64().unwrap() as usize);
        for column in 0..2 {
            let (low, high) = (at + 6 * column, at + 6 * column + 3);
            let mut before = 0_u16;
            for (i, row) in rows.iter().enumerate() {
                let step = u16::from_le_bytes([bytes[low + i], bytes[high + i]]);
                before = before.wrapping_add((step >> 1) ^ (step & 1).wrapping_neg());
                assert_eq!(before, row[column]);
            }
        }
        let text = pack.finish();
        let digit =
            |c: u8| b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/".iter().position(|&it| it == c);
        let bits: Vec<u8> =
            text.bytes().filter_map(digit).flat_map(|d| (0..6).rev().map(move |k| (d >> k & 1) as u8)).collect();
        let deflated: Vec<u8> = bits.chunks_exact(8).map(|it| it.iter().fold(0, |byte, bit| byte << 1 | bit)).collect();
        let mut back = Vec::new();
        ZlibDecoder::new(&deflated[..]).read_to_end(&mut back).unwrap();
        assert_eq!(back, bytes);
    }
}
