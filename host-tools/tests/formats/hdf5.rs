//! HDF5 as MATLAB writes it: MAT files of version 7.3, byte by byte.

use crate::write::RATE;
use flate2::Compression;
use flate2::write::ZlibEncoder;
use std::borrow::Borrow;
use std::io::{Cursor, Seek, SeekFrom, Write};

/// Bytes of text above the superblock.
const BLOCK: usize = 512;

/// A variable: rows and columns, numbers column by column, single precision or double.
pub struct Variable {
    pub name: String,
    pub shape: [usize; 2],
    pub values: Vec<f64>,
    pub single: bool,
}

impl Variable {
    pub fn vector(name: &str, readings: &[f32], single: bool) -> Self {
        Self {
            name: name.to_owned(),
            shape: [readings.len(), 1],
            values: readings.iter().map(|x| f64::from(*x)).collect(),
            single,
        }
    }

    pub fn rate() -> Self {
        Self {
            name: "Fs".to_owned(),
            shape: [1, 1],
            values: vec![RATE],
            single: false,
        }
    }
}

/// The parts of a file at their addresses.
struct Writer<W> {
    out: W,
    len: usize,
}

impl<W: Write> Writer<W> {
    fn put(&mut self, bytes: &[u8]) {
        self.out.write_all(bytes).unwrap();
        self.len += bytes.len();
    }

    /// Adds bytes at a multiple of eight; their address.
    fn add(&mut self, bytes: &[u8]) -> u64 {
        self.put(&vec![0; self.len.next_multiple_of(8) - self.len]);
        let at = (self.len - BLOCK) as u64;
        self.put(bytes);
        at
    }
}

fn message(kind: u16, body: &[u8]) -> Vec<u8> {
    let size = body.len().next_multiple_of(8);
    let mut out = [kind.to_le_bytes(), (size as u16).to_le_bytes()].concat();
    out.extend([0; 4]);
    out.extend(body);
    out.resize(8 + size, 0);
    out
}

fn header(messages: &[Vec<u8>]) -> Vec<u8> {
    let all = messages.concat();
    let mut out = vec![1, 0];
    out.extend((messages.len() as u16).to_le_bytes());
    out.extend(1_u32.to_le_bytes());
    out.extend((all.len() as u32).to_le_bytes());
    out.extend([0; 4]);
    out.extend(all);
    out
}

fn words(words: &[u64]) -> Vec<u8> {
    words.iter().flat_map(|word| word.to_le_bytes()).collect()
}

fn space(shape: &[u64]) -> Vec<u8> {
    let lead = [1, shape.len() as u8, 0, 0, 0, 0, 0, 0];
    [lead.to_vec(), words(shape)].concat()
}

fn datatype(single: bool) -> Vec<u8> {
    let mut out = vec![0x11, 0x20, if single { 31 } else { 63 }, 0];
    out.extend(if single { 4_u32 } else { 8 }.to_le_bytes());
    let (bits, layout, bias) = match single {
        true => (32_u16, [23_u8, 8, 0, 23], 127_u32),
        false => (64, [52, 11, 0, 52], 1023),
    };
    out.extend([0, 0]);
    out.extend(bits.to_le_bytes());
    out.extend(layout);
    out.extend(bias.to_le_bytes());
    out
}

/// Attribute `MATLAB_class`.
fn class(single: bool) -> Vec<u8> {
    let text = if single { "single" } else { "double" };
    let kind = [&[0x13, 0, 0, 0], &6_u32.to_le_bytes()[..]].concat();
    let mut body = vec![1, 0, 13, 0, 8, 0, 8, 0];
    body.extend(b"MATLAB_class\0\0\0\0");
    body.extend(kind);
    body.extend([1, 0, 0, 0, 0, 0, 0, 0]);
    body.extend(text.bytes());
    message(0x0c, &body)
}

/// The numbers of a variable in chunks of so many samples, shuffled and compressed.
fn chunked<W: Write>(
    file: &mut Writer<W>,
    variable: &Variable,
    raw: &[u8],
    chunk: usize,
) -> [Vec<u8>; 2] {
    let size = if variable.single { 4 } else { 8 };
    let [rows, columns] = variable.shape;
    let mut entries = Vec::new();
    let mut count = 0_u16;
    for column in 0..columns {
        for begin in (0..rows).step_by(chunk) {
            // A chunk at the edge is whole in the file.
            let mut numbers = vec![0; chunk * size];
            let from = (column * rows + begin) * size;
            let long = (rows - begin).min(chunk) * size;
            numbers[..long].copy_from_slice(&raw[from..from + long]);
            let planes = (0..size).flat_map(|b| numbers.iter().skip(b).step_by(size).copied());
            let shuffled: Vec<u8> = planes.collect();
            let mut encoder = ZlibEncoder::new(Vec::new(), Compression::new(3));
            encoder.write_all(&shuffled).unwrap();
            let packed = encoder.finish().unwrap();
            entries.extend((packed.len() as u32).to_le_bytes());
            entries.extend([0; 4]);
            entries.extend(words(&[column as u64, begin as u64, 0]));
            entries.extend(words(&[file.add(&packed)]));
            count += 1;
        }
    }
    // Behind the last chunk.
    entries.extend([0; 8]);
    entries.extend(words(&[columns as u64, 0, 0]));
    let mut tree = b"TREE\x01\x00".to_vec();
    tree.extend(count.to_le_bytes());
    tree.extend([0xff; 16]);
    tree.extend(entries);
    let tree = file.add(&tree);
    let mut layout = vec![3, 2, 3];
    layout.extend(words(&[tree]));
    layout.extend(
        [1, chunk as u32, size as u32]
            .iter()
            .flat_map(|n| n.to_le_bytes()),
    );
    let mut filters = vec![1, 2, 0, 0, 0, 0, 0, 0];
    for (number, value) in [(2_u16, size as u32), (1, 3)] {
        filters.extend(number.to_le_bytes());
        filters.extend([0, 0, 1, 0, 1, 0]);
        filters.extend(value.to_le_bytes());
        filters.extend([0; 4]);
    }
    [message(0x08, &layout), message(0x0b, &filters)]
}

/// A MAT file of version 7.3; `chunk` samples a compressed chunk, or each variable in one piece.
pub fn mat73(variables: &[Variable], chunk: Option<usize>) -> Vec<u8> {
    let mut out = Cursor::new(Vec::new());
    write_mat73(&mut out, variables.iter(), chunk);
    out.into_inner()
}

/// The same variable by variable.
pub fn write_mat73<V: Borrow<Variable>>(
    out: &mut (impl Write + Seek),
    variables: impl Iterator<Item = V>,
    chunk: Option<usize>,
) {
    let mut file = Writer { out, len: 0 };
    let mut text = b"MATLAB 7.3 MAT-file, Platform: GLNXA64".to_vec();
    text.resize(116, b' ');
    text.resize(124, 0);
    text.extend(b"\x00\x02IM");
    text.resize(BLOCK + 96, 0);
    file.put(&text);
    let mut links = Vec::new();
    for variable in variables {
        let variable = variable.borrow();
        let numbers = variable.values.iter();
        let raw: Vec<u8> = match variable.single {
            true => numbers.flat_map(|x| (*x as f32).to_le_bytes()).collect(),
            false => numbers.flat_map(|x| x.to_le_bytes()).collect(),
        };
        // Columns are rows of the file.
        let [rows, columns] = variable.shape.map(|n| n as u64);
        let mut messages = vec![
            message(0x01, &space(&[columns, rows])),
            message(0x03, &datatype(variable.single)),
            class(variable.single),
        ];
        match chunk.filter(|_| variable.values.len() > 1) {
            Some(chunk) => messages.extend(chunked(&mut file, variable, &raw, chunk)),
            None => {
                let mut layout = vec![3, 1];
                layout.extend(words(&[file.add(&raw), raw.len() as u64]));
                messages.push(message(0x08, &layout));
            }
        }
        links.push((variable.name.clone(), file.add(&header(&messages))));
    }
    links.sort();
    let mut names = vec![0; 8];
    let mut table = b"SNOD\x01\x00".to_vec();
    table.extend((links.len() as u16).to_le_bytes());
    for (name, at) in links {
        table.extend(words(&[names.len() as u64, at, 0, 0, 0]));
        names.extend(name.bytes());
        names.resize((names.len() + 1).next_multiple_of(8), 0);
    }
    let table = file.add(&table);
    let data = file.add(&names);
    let mut heap = b"HEAP\x00\x00\x00\x00".to_vec();
    heap.extend(words(&[names.len() as u64, u64::MAX, data]));
    let heap = file.add(&heap);
    let mut tree = b"TREE\x00\x00\x01\x00".to_vec();
    tree.extend([0xff; 16]);
    tree.extend(words(&[0, table, 8]));
    let tree = file.add(&tree);
    let root = file.add(&header(&[message(0x11, &words(&[tree, heap]))]));
    let mut block = b"\x89HDF\r\n\x1a\n\x00\x00\x00\x00\x00\x08\x08\x00".to_vec();
    block.extend([4, 0, 16, 0, 0, 0, 0, 0]);
    block.extend(words(&[BLOCK as u64, u64::MAX, file.len as u64, u64::MAX]));
    block.extend(words(&[0, root, 0, 0, 0]));
    file.out.seek(SeekFrom::Start(BLOCK as u64)).unwrap();
    file.out.write_all(&block).unwrap();
}
