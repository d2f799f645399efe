//! Lines that are frames.

use _native::frames::{BRS, DLC_SHIFT, ESI, EXTENDED, FD, NO_TIME, REMOTE, RX, TX};

use crate::{expect, frame, parse, reason, texts};

const T: i64 = 1_436_509_052_249_713_000;
const ONE_TO_8: [u8; 8] = [1, 2, 3, 4, 5, 6, 7, 8];

#[test]
fn log_lines() {
    let data = [0x2A, 0x36, 0x6C, 0x2B, 0xBA];
    for (suffix, flags) in [
        ("", 0),
        ("\n", 0),
        ("\r\n", 0),
        (" R\n", RX),
        (" T", TX),
        (" R\r\n", RX),
        ("  \t\n", 0),
    ] {
        expect(
            &format!("(1436509052.249713) vcan0 044#2A366C2BBA{suffix}"),
            T,
            "vcan0",
            0x44,
            flags,
            &data,
        );
        let extended = format!("  (1436509052.249713)  vcan0  0000044f#2a366c2bba{suffix}");
        expect(&extended, T, "vcan0", 0x44F, flags | EXTENDED, &data);
    }
    for (stamp, t) in [
        ("1.5", 1_500_000_000),
        ("1436509052.249713001", T + 1),
        ("0.000", 0),
        ("5.00000004", 5_000_000_040),
    ] {
        expect(&format!("({stamp}) can0 123#"), t, "can0", 0x123, 0, &[]);
    }
    expect("can0 123#11.22.33", NO_TIME, "can0", 0x123, 0, &[0x11, 0x22, 0x33]);
    expect("can0 7#FF", NO_TIME, "can0", 7, 0, &[0xFF]);
    expect("can0 12333#FF", NO_TIME, "can0", 0x12333, EXTENDED, &[0xFF]);
    expect("can0 9F040A05#00", NO_TIME, "can0", 0x1F04_0A05, EXTENDED, &[0]);
    expect("can0 1FFFFFFF#", NO_TIME, "can0", 0x1FFF_FFFF, EXTENDED, &[]);
}

#[test]
fn log_lines_with_a_length_code() {
    expect(
        "(1.0) can0 00000123#R",
        1_000_000_000,
        "can0",
        0x123,
        EXTENDED | REMOTE,
        &[],
    );
    expect(
        "can0 123#r8 T",
        NO_TIME,
        "can0",
        0x123,
        REMOTE | TX | 8 << DLC_SHIFT,
        &[],
    );
    expect("can0 123#R8_9", NO_TIME, "can0", 0x123, REMOTE | 9 << DLC_SHIFT, &[]);
    expect(
        "can0 123#0102030405060708_B",
        NO_TIME,
        "can0",
        0x123,
        0xB << DLC_SHIFT,
        &ONE_TO_8,
    );
    for body in [
        "01_9",
        "0102030405060708_8",
        "0102030405060708_",
        "0102030405060708_99",
        "0102030405060708_G",
    ] {
        let said = reason(format!("can0 123#{body}").as_bytes());
        assert_eq!(
            said, "a raw length code needs 8 bytes and one digit from 9 to F",
            "{body}"
        );
    }
    for body in ["R9", "RR", "R8_8", "R7_9", "R8_9A", "R8_"] {
        let said = reason(format!("can0 123#{body}").as_bytes());
        assert_eq!(said, "length of the remote request not understood", "{body}");
    }
}

#[test]
fn can_fd_log_lines_with_every_flag_digit() {
    for flags in 0..16_u16 {
        let expected = FD | if flags & 1 != 0 { BRS } else { 0 } | if flags & 2 != 0 { ESI } else { 0 };
        expect(
            &format!("can0 123##{flags:X}0102"),
            NO_TIME,
            "can0",
            0x123,
            expected,
            &[1, 2],
        );
        expect(
            &format!("can0 123##{flags:x}.01.02 R"),
            NO_TIME,
            "can0",
            0x123,
            expected | RX,
            &[1, 2],
        );
    }
    let longest: Vec<u8> = (0..64).collect();
    let hex: String = longest.iter().map(|b| format!("{b:02X}")).collect();
    expect(
        &format!("can0 00000123##5{hex}"),
        NO_TIME,
        "can0",
        0x123,
        EXTENDED | FD | BRS,
        &longest,
    );
    expect("can0 123##4", NO_TIME, "can0", 0x123, FD, &[]);
    assert_eq!(
        reason(format!("can0 123##5{hex}40").as_bytes()),
        "data longer than 64 bytes"
    );
    assert_eq!(reason(b"can0 123##"), "no CAN FD flags");
    assert_eq!(reason(b"can0 123##x11"), "no CAN FD flags");
}

#[test]
fn console_lines() {
    let bytes = "01 02 03 04 05 06 07 08";
    for (line, t) in [
        (format!("  can0  123   [8]  {bytes}"), NO_TIME),
        (format!("can0 123 [8] {bytes}   \r\n"), NO_TIME),
        (format!(" (1436509052.249713)  can0  123   [8]  {bytes}"), T),
        (
            format!(" (2020-12-19 12:04:45.485261)  can0  123   [8]  {bytes}"),
            1_608_379_485_485_261_000,
        ),
        (format!(" (015.052211)  can0  123   [8]  {bytes}"), 15_052_211_000),
        (format!("Normal (000.000180)  can0  123   [8]  {bytes}"), 180_000),
        (format!("  can0  123   [8]  {bytes}   'a [9] ' \"`#.'"), NO_TIME),
        (format!("  can0  123   [8]  {bytes}   ''''''''''"), NO_TIME),
        (format!("\x1b[1m\x1b[34m  can0  123   [8]  {bytes}\x1b[0m"), NO_TIME),
        (
            "  can0  123   [8]  08`07`06`05`04`03`02`01   `........`".to_owned(),
            NO_TIME,
        ),
    ] {
        expect(&line, t, "can0", 0x123, 0, &ONE_TO_8);
    }
    expect(
        " can0 00000123 [2] 00010001 11111110  '..'",
        NO_TIME,
        "can0",
        0x123,
        EXTENDED,
        &[0x11, 0xFE],
    );
    expect("  can0       123   [0] ", NO_TIME, "can0", 0x123, 0, &[]);
    expect(
        "  can0  123  {B}  01 02 03 04 05 06 07 08",
        NO_TIME,
        "can0",
        0x123,
        0xB << DLC_SHIFT,
        &ONE_TO_8,
    );
    expect("  can0  123  {2}  01 02", NO_TIME, "can0", 0x123, 0, &[1, 2]);
}

#[test]
fn console_lines_with_more_than_data() {
    expect(
        "  can0  00000123   [0]  remote request",
        NO_TIME,
        "can0",
        0x123,
        EXTENDED | REMOTE,
        &[],
    );
    expect(
        "  can0  123   [8]  remote request",
        NO_TIME,
        "can0",
        0x123,
        REMOTE | 8 << DLC_SHIFT,
        &[],
    );
    expect("  can0  123  [02]  01 02", NO_TIME, "can0", 0x123, FD, &[1, 2]);
    expect(
        "  can0  123 [010]  01 02 03 04 05 06 07 08 09 0A",
        NO_TIME,
        "can0",
        0x123,
        FD,
        &[1, 2, 3, 4, 5, 6, 7, 8, 9, 10],
    );
    let longest: Vec<u8> = (0..64).collect();
    let hex: String = longest.iter().map(|b| format!(" {b:02x}")).collect();
    expect(
        &format!("  can0  TX B E  077  [64] {hex}"),
        NO_TIME,
        "can0",
        0x77,
        FD | TX | BRS | ESI,
        &longest,
    );
    expect("  can0  RX - -  077   [1]  01   '.'", NO_TIME, "can0", 0x77, RX, &[1]);
    expect(
        " (2024-12-11 09:27:19.445269)  can0  TX B -  077  [01]  05",
        1_733_909_239_445_269_000,
        "can0",
        0x77,
        FD | TX | BRS,
        &[5],
    );
}

#[test]
fn interface_names() {
    for name in [
        "vcan-0",
        "vcan.0",
        "can0:1",
        "averylongname15",
        "a-name-that-linux-has-not",
        "RX",
        "[8]",
    ] {
        assert_eq!(frame(&format!("(1.0) {name} 123#11")).1, name);
        assert_eq!(frame(&format!("  {name}  123   [1]  11")).1, name);
    }
    let (candump, frames, _) = parse(b"(1.0) c\xE4n 123#\n(1.0) c\\xe4n 123#\n(1.0) c\x01n 123#\n(1.0) c\xE4n 123#\n");
    assert_eq!(
        (candump.buses(), frames.bus.as_slice()),
        (&["c\\xe4n".to_owned(), "c\\x01n".to_owned()][..], &[0, 0, 1, 0][..])
    );

    let many: String = (0..256).map(|bus| format!("(1.0) can{bus} 123#\n")).collect();
    let (candump, frames, events) = parse(many.as_bytes());
    assert_eq!((candump.buses().len(), frames.len(), frames.bus[254]), (255, 255, 254));
    assert_eq!(texts(&events), ["more than 255 interfaces: (1.0) can255 123#"]);
}
