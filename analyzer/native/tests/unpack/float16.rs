use crate::oracle;
use crate::table::{decode, Value};
use _native::bits::half;

#[test]
fn all_codes_are_exact() {
    for raw in 0..=u16::MAX {
        assert_eq!(half(raw), oracle::half(raw), "{raw:#06X}");
    }
}

#[test]
fn known_codes() {
    let known = [
        (0x0000, 0.0_f32),
        (0x8000, -0.0),
        (0x0001, 5.960_464_5e-8),
        (0x03FF, 6.097_555e-5),
        (0x0400, 6.103_515_6e-5),
        (0x3C00, 1.0),
        (0xC000, -2.0),
        (0x4E40, 25.0),
        (0x7BFF, 65504.0),
        (0x7C00, f32::INFINITY),
        (0xFC00, f32::NEG_INFINITY),
    ];
    for (raw, value) in known {
        assert_eq!(half(raw), value.to_bits(), "{raw:#06X}");
    }
    // A NaN keeps sign, payload and that it signals.
    assert_eq!((half(0x7E01), half(0xFC01)), (0x7FC0_2000, 0xFF80_2000));
}

#[test]
fn in_a_column_by_itself_and_in_a_list() {
    let wire: &[u8] = &[0x00, 0x3C, 0x01, 0xFC];
    let one = Value::Single(1_f32.to_bits());
    let nan = Value::Single(0xFF80_2000);
    let pair = Value::Struct(vec![one.clone(), nan.clone()]);
    assert_eq!(
        decode(&[("struct", 2, 0), ("float", 16, 0), ("float", 16, 0)], 0, &[wire; 3])[2].value,
        pair
    );
    let list = Value::Struct(vec![Value::List(vec![one, nan])]);
    assert_eq!(
        decode(&[("struct", 1, 0), ("list", 4, 3), ("float", 16, 0)], 0, &[wire; 3])[2].value,
        list
    );
}
