//! QR codes for a terminal.

use anyhow::Context;
use qrcode::render::unicode::Dense1x2;
use qrcode::{EcLevel, QrCode};

/// A text as a QR code of half blocks, for light letters on a dark ground.
pub(super) fn text(content: &str) -> anyhow::Result<String> {
    let code = QrCode::with_error_correction_level(content, EcLevel::L)
        .with_context(|| format!("{} characters are too many for a QR code", content.len()))?;
    Ok(code.render::<Dense1x2>().dark_color(Dense1x2::Light).light_color(Dense1x2::Dark).build())
}
