//! MCAP message records: order, places, chunks.

use _native::write::records::{merged, Batch};

const ENDLESS: usize = usize::MAX;

/// Channel, log time and message of each record; the place of a record is where it was found.
fn walk(mut data: &[u8]) -> Vec<(usize, u16, u64, Vec<u8>)> {
    let (whole, mut found) = (data.len(), vec![]);
    while !data.is_empty() {
        let number = |at: usize| u64::from_le_bytes(data[at..at + 8].try_into().unwrap());
        assert_eq!(data[0], 5);
        let length = number(1) as usize;
        assert_eq!(data[11..15], [0; 4]);
        assert_eq!(number(15), number(23));
        let channel = u16::from_le_bytes([data[9], data[10]]);
        found.push((whole - data.len(), channel, number(15), data[31..9 + length].to_vec()));
        data = &data[9 + length..];
    }
    found
}

/// The places that a message index record gives, with their times.
fn places(record: &[u8], channel: u16) -> Vec<(u64, u64)> {
    assert_eq!(record[0], 7);
    assert_eq!(record[1..9], (record.len() as u64 - 9).to_le_bytes());
    assert_eq!(record[9..11], channel.to_le_bytes());
    assert_eq!(record[11..15], (record.len() as u32 - 15).to_le_bytes());
    let number = |bytes: &[u8]| u64::from_le_bytes(bytes.try_into().unwrap());
    record[15..]
        .chunks(16)
        .map(|pair| (number(&pair[..8]), number(&pair[8..])))
        .collect()
}

fn two() -> [Batch<'static>; 2] {
    [
        Batch {
            channels: &[1, 3],
            times: &[10, 30],
            ends: &[1, 3],
            data: b"abb",
        },
        Batch {
            channels: &[2, 2, 1],
            times: &[20, 10, 40],
            ends: &[0, 2, 3],
            data: b"ccd",
        },
    ]
}

#[test]
fn by_time_and_in_order_of_the_batches() {
    let chunks = merged(&two(), 100, ENDLESS);
    assert_eq!(chunks.len(), 1);
    let found = walk(&chunks[0].messages);
    let said: Vec<_> = found
        .iter()
        .map(|(_, channel, t, data)| (*channel, *t, data.as_slice()))
        .collect();
    let expected: [(u16, u64, &[u8]); 5] = [
        (1, 10, b"a"),
        (2, 10, b"cc"),
        (2, 20, b""),
        (3, 30, b"bb"),
        (1, 40, b"d"),
    ];
    assert_eq!(said, expected);
    assert_eq!(chunks[0].span, (10, 40));
    let counts: Vec<_> = chunks[0].indexes.iter().map(|(id, _, count)| (*id, *count)).collect();
    assert_eq!(counts, [(1, 2), (2, 2), (3, 1)]);
    for (id, record, _) in &chunks[0].indexes {
        let of = found.iter().filter(|(_, channel, ..)| channel == id);
        let expected: Vec<_> = of.map(|(at, _, t, _)| (*t, *at as u64 + 100)).collect();
        assert_eq!(places(record, *id), expected);
    }
}

#[test]
fn in_chunks_that_each_start_anew() {
    let chunks = merged(&two(), 100, 60);
    assert_eq!(
        chunks
            .iter()
            .map(|chunk| walk(&chunk.messages).len())
            .collect::<Vec<_>>(),
        [2, 2, 1]
    );
    assert_eq!(
        chunks.iter().map(|chunk| chunk.span).collect::<Vec<_>>(),
        [(10, 10), (20, 30), (40, 40)]
    );
    let first_places: Vec<_> = chunks
        .iter()
        .map(|chunk| places(&chunk.indexes[0].1, chunk.indexes[0].0)[0].1)
        .collect();
    assert_eq!(first_places, [100, 0, 0]);
}

#[test]
fn nothing_gives_nothing() {
    assert!(merged(&[], 5, ENDLESS).is_empty());
}

#[test]
fn columns_that_do_not_fit() {
    let [good, _] = two();
    assert!(good.fits());
    for ends in [&[1][..], &[2, 1], &[1, 4]] {
        let [batch, _] = two();
        assert!(!Batch { ends, ..batch }.fits());
    }
    let [batch, _] = two();
    assert!(!Batch {
        times: &[1, -1],
        ..batch
    }
    .fits());
}
