//! Navigation message words as satellites sent them: data, quoted from the tests of the GNSSTk (University of Texas).
#![allow(dead_code, clippy::unwrap_used)] // not every test uses everything; helpers of tests

/// Subframes 1, 2, 3 and page 18 of subframe 4 of GPS PRN 4 at the start of week 1869.
pub const PRN4: [[u32; 10]; 4] = [
    [
        0x22C34D21, 0x000029D4, 0x34D44000, 0x091B1DE7, 0x1C33746E, 0x2F701369, 0x39F53CB5, 0x128070A8,
        0x003FF454, 0x3EAFC2F0,
    ],
    [
        0x22C34D21, 0x00004A44, 0x12BFCB3A, 0x0D7A9094, 0x3B99FBAF, 0x3FC081B8, 0x09D171E1, 0x04B0A847,
        0x03497656, 0x00709FA0,
    ],
    [
        0x22C34D21, 0x00006BCC, 0x3FE14ED4, 0x05ABBB58, 0x3FE3498B, 0x145EE03A, 0x062ECB6F, 0x1C48068F,
        0x3FE95E1E, 0x12844624,
    ],
    [
        0x22C34D21, 0x000B2C64, 0x1E05FFE1, 0x3F808FEC, 0x3F7F405F, 0x00000413, 0x0000003F, 0x01491376,
        0x044EC0EB, 0x044000D8,
    ],
];

/// Words 1 to 5 of E01 in Galileo week 1014 (GPS week 2038).
pub const E01: [[u32; 4]; 5] = [
    [0x045E86B2, 0x14606028, 0x0039B8BE, 0xA813EC77],
    [0x085E78BB, 0x0E292854, 0x403C05B7, 0x23FFF7FD],
    [0x0C5EFFC8, 0x1B1BAB09, 0xAB19670C, 0x0B0C496B],
    [0x105E07FF, 0xE3FFFA1A, 0xCFEE8486, 0xFFFDC601],
    [0x145B82A0, 0x0581F67D, 0x401FB3F4, 0x8CAAAAAA],
];

/// Subframes 1 to 3 of C06 in BeiDou week 810, from second 345614 on.
pub const C06: [[u32; 10]; 3] = [
    [
        0x38901541, 0x18000020, 0x0654A846, 0x30052F4E, 0x2D070427, 0x3EC1CDC2, 0x30BF8085, 0x1C0028C1,
        0x3F47E038, 0x1A8AE13D,
    ],
    [
        0x38902543, 0x18183473, 0x25F68C9D, 0x3FC82650, 0x1B1C17A5, 0x070E0107, 0x0B05EE24, 0x1AD7F7D4,
        0x033CAE4C, 0x3B50A9BC,
    ],
    [
        0x3890354C, 0x18314682, 0x004D0280, 0x3C6D0016, 0x0557FF9F, 0x190DFFB2, 0x36E264FC, 0x363DCF4D,
        0x3AB53A34, 0x145AB4D0,
    ],
];

/// Pages 1 to 10 of subframe 1 of C01 at the same time, their first five words.
const C01: [[u32; 5]; 10] = [
    [0x38901541, 0x18004027, 0x00654A7C, 0x2303C840, 0x39B015EA],
    [0x38901541, 0x180C8114, 0x304FB0CA, 0x1CDC2F71, 0x380755B6],
    [0x38901541, 0x1818C079, 0x00000000, 0x000DC13C, 0x3C88153A],
    [0x38901541, 0x18250AEB, 0x0E4C00E9, 0x01F8D7D5, 0x373C55E4],
    [0x38901541, 0x18317E86, 0x31E9F0F9, 0x047BD7C7, 0x3C015552],
    [0x38901541, 0x183D90BD, 0x35CA72D3, 0x2EB5040A, 0x3FFE55F9],
    [0x38901541, 0x1849CEA7, 0x3002B543, 0x14600143, 0x304F55C6],
    [0x38901541, 0x185621FD, 0x301EAF12, 0x3C0CB863, 0x002515CC],
    [0x38901541, 0x18626153, 0x005173D2, 0x0146E114, 0x238B552F],
    [0x38901541, 0x186E8E6B, 0x08A8AA59, 0x2AAAAAB4, 0x2AAAAAB4],
];

/// The words after those, as they were sent with the first page.
const REST: [u32; 5] = [0x1555554B; 5];

/// The same with all words.
pub fn c01() -> Vec<[u32; 10]> {
    C01.iter().map(|words| [words.as_slice(), &REST].concat().try_into().unwrap()).collect()
}

/// Pages 1 to 4 of E01 in Galileo week 1014 (GPS week 2038), from second 518400 on: seven parts of 32 bits, and then 20.
const E01_FNAV: [[u32; 8]; 4] = [
    [0x04117A1A, 0xCFEE8487, 0xBFFDC701, 0xAC5B82A0, 0x0581F607, 0xECFD200A, 0xAAAAAA0C, 0x20700],
    [0x085E8518, 0x180AFFC8, 0x1B000E6E, 0x2FAA04FB, 0x1D78BB0E, 0x29F7FCFD, 0x9FA42863, 0x906C0],
    [0x0C5E2854, 0x403C05B7, 0x23FF1BAB, 0x09AB1967, 0x0C0B0C49, 0x86B0FD9F, 0xA4515734, 0x8A300],
    [0x105EFFF8, 0xFFFEFFFF, 0xFFFF0000, 0x011278F6, 0x89E2521F, 0xE4FFE3B3, 0xF48F299B, 0x07040],
];

/// The same without tail bits, 238 bits in 30 bytes.
pub fn e01_fnav() -> Vec<Vec<u8>> {
    let bytes = |page: &[u32; 8]| {
        let [parts @ .., last] = page;
        let mut bytes: Vec<u8> = parts.iter().flat_map(|part| part.to_be_bytes()).collect();
        // 14 of the last 20 bits.
        bytes.extend_from_slice(&((last & 0xfffc0) << 12).to_be_bytes()[..2]);
        bytes
    };
    E01_FNAV.iter().map(bytes).collect()
}

/// Strings 1 to 4 of slot 1 on 27 June 2015, 3:40:00 in Moscow.
const R01: [[u32; 3]; 4] = [
    [0x080E8452, 0x5A9449E9, 0x1B364800],
    [0x108F0186, 0xB0304527, 0xCD987800],
    [0x1C003435, 0xA6949646, 0x1DCBC800],
    [0x20500C09, 0x00000113, 0xE82AE800],
];

/// The same in 11 bytes each.
pub fn r01() -> Vec<Vec<u8>> {
    let bytes = |parts: &[u32; 3]| parts.iter().flat_map(|part| part.to_be_bytes()).take(11).collect();
    R01.iter().map(bytes).collect()
}
