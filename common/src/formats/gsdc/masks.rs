//! Masks by the phone's statements on its own measurement. Tables since 2022 keep these columns and every row of the log, so the
//! log's masks apply.

use super::columns::Optional;
use super::fields::{Fault, Fields};
use crate::constants::SPEED_OF_LIGHT_MPS;
use crate::formats::android::MULTIPATH_DETECTED;
use crate::formats::gnsslogger::Masks;
use crate::gnss::Constellation;
use crate::skips::Reason;

/// Checks a row; a value that the table does not have passes.
pub(super) fn check(fields: &Fields<'_>, constellation: Constellation, masks: &Masks) -> Result<(), Fault> {
    let state = fields.bits(Optional::State);
    if let Some(state) = state.filter(|state| !masks.states.of(constellation).passes(*state)) {
        return refuse(Reason::MaskStateBits, "State", f64::from(state));
    }
    if masks.reject_multipath && fields.bits(Optional::Multipath).map(i64::from) == Some(MULTIPATH_DETECTED) {
        return refuse(Reason::MaskMultipath, "MultipathIndicator", 1.0);
    }
    above(
        fields,
        Optional::BiasUncertainty,
        masks.max_bias_uncertainty_ns,
        Reason::MaskClockBiasUncertainty,
    )?;
    let (longest_ns, reason) = (masks.max_received_time_uncertainty_ns, Reason::MaskReceivedTimeUncertainty);
    above(fields, Optional::ReceivedTimeUncertainty, longest_ns, reason)?;
    let longest_m = longest_ns * 1e-9 * SPEED_OF_LIGHT_MPS;
    above(fields, Optional::PseudorangeUncertainty, longest_m, reason)
}

fn above(fields: &Fields<'_>, column: Optional, limit: f64, reason: Reason) -> Result<(), Fault> {
    match fields.optional(column).filter(|value| *value > limit) {
        Some(value) => refuse(reason, fields.columns.optional_name(column), value),
        None => Ok(()),
    }
}

fn refuse(reason: Reason, column: &str, value: f64) -> Result<(), Fault> {
    Err(Fault { reason, detail: format!("{column} = {value}") })
}
