//! The records of a whole observation file, as a stream gives them.

use cofix_common::formats::decode::Record;
use cofix_common::formats::rinex::ObservationFile;

/// Epochs and events in the file's order.
pub fn into_records(file: ObservationFile) -> Vec<Record> {
    let mut events = file.events.into_iter().peekable();
    let mut records = Vec::with_capacity(file.epochs.len() + events.len());
    for (index, epoch) in file.epochs.into_iter().enumerate() {
        while let Some((_, event)) = events.next_if(|(before, _)| *before <= index) {
            records.push(Record::Event(Box::new(event)));
        }
        records.push(Record::Epoch(epoch));
    }
    records.extend(events.map(|(_, event)| Record::Event(Box::new(event))));
    records
}
