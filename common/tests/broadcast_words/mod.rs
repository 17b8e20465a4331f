//! Navigation message words as satellites sent them: data, quoted from the tests of the GNSSTk (University of Texas).

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
