//! Events of the group's integrity in words: for the log, the report and the recording.

use cofix_common::fusion::engine::FusedEpoch;
use cofix_common::fusion::peers::{EventKind, IntegrityEvent};

use super::EventReport;

impl EventReport {
    /// An event of an epoch, with the phones' names. A constraint that is contradicted is among the epoch's actions.
    pub(crate) fn of(event: &IntegrityEvent, epoch: &FusedEpoch, names: &[String]) -> Self {
        let phones: Vec<&str> =
            event.phones.iter().filter_map(|phone| names.get(*phone)).map(String::as_str).collect();
        let phone = phones.join(", ");
        let detail = match event.kind {
            EventKind::Isolated => {
                let error = event.error.unwrap_or_default().in_words();
                format!("{phone} contradicts the other phones and is isolated: {error}")
            }
            EventKind::Readmitted => format!("{phone} agrees with the other phones again"),
            EventKind::ConstraintContradicted => {
                format!("the constraint{} on {phone} contradicts them", bound(event, epoch))
            }
            EventKind::CannotTell if event.constraint.is_some() => format!(
                "{phone} contradict the constraint{}, and whether it or which of them is wrong is open",
                bound(event, epoch)
            ),
            EventKind::CannotTell => format!("{phone} contradict each other, and which is wrong is open"),
        };
        Self { time_gps: event.time_gps.iso(), phone, kind: event.kind, error: event.error, detail }
    }
}

fn bound(event: &IntegrityEvent, epoch: &FusedEpoch) -> String {
    let action = epoch.actions.iter().find(|action| Some(action.index) == event.constraint);
    action.map_or_else(String::new, |action| {
        format!(" {} {}", action.constraint.name(), action.constraint.bounds_in_words())
    })
}

#[cfg(test)]
mod tests {
    use cofix_common::constraint::{ConstraintAction, ConstraintOutcome, Distance, SkipReason};
    use cofix_common::fusion::peers::ErrorKind;
    use cofix_common::time::GpsTime;

    use super::*;

    #[test]
    fn events_are_put_into_words() {
        let time_gps = GpsTime::from_week_tow(2118, 397_800.0);
        let event = |phones: &[usize], constraint, kind| IntegrityEvent {
            time_gps,
            phones: phones.to_vec(),
            constraint,
            kind,
            error: (kind == EventKind::Isolated).then_some(ErrorKind::Frozen),
        };
        let action = ConstraintAction {
            index: 3,
            constraint: Distance { phones: [0, 1], minimum_m: 0.0, maximum_m: 2.0 }.into(),
            before: 9.0,
            free_sigmas: 7.0,
            after: 9.0,
            shift_m: 0.0,
            enlargements: 0,
            outcome: ConstraintOutcome::Skipped(SkipReason::Contradicted),
        };
        let epoch = FusedEpoch {
            time_gps,
            phones: Vec::new(),
            actions: vec![action],
            distances: Vec::new(),
            events: Vec::new(),
        };
        let names = ["a", "b"].map(str::to_owned);
        for (event, phone, detail) in [
            (
                event(&[1], None, EventKind::Isolated),
                "b",
                "b contradicts the other phones and is isolated: its position does not move while the others do (frozen)",
            ),
            (event(&[1], None, EventKind::Readmitted), "b", "b agrees with the other phones again"),
            (
                event(&[0, 1], Some(3), EventKind::ConstraintContradicted),
                "a, b",
                "the constraint distance 0 to 2 m on a, b contradicts them",
            ),
            (
                event(&[0, 1], Some(4), EventKind::ConstraintContradicted),
                "a, b",
                "the constraint on a, b contradicts them",
            ),
            (
                event(&[0, 1], Some(3), EventKind::CannotTell),
                "a, b",
                "a, b contradict the constraint distance 0 to 2 m, and whether it or which of them is wrong is open",
            ),
            (
                event(&[0, 1], None, EventKind::CannotTell),
                "a, b",
                "a, b contradict each other, and which is wrong is open",
            ),
        ] {
            let told = EventReport::of(&event, &epoch, &names);
            assert_eq!((told.phone.as_str(), told.detail.as_str()), (phone, detail));
            assert_eq!((told.time_gps, told.kind), (time_gps.iso(), event.kind));
        }
    }
}
