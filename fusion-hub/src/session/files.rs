//! The files that a session reads. Outputs must not be among them.

use std::path::Path;

use cofix_agent::CorrectionSource;
use cofix_agent::files::Named;

use crate::session::Session;

/// All files that a session names, with the session file itself.
pub fn inputs(file: &Path, session: &Session) -> Vec<Named> {
    let mut inputs = live_inputs(file, session);
    let products = &session.products;
    for (what, paths) in [
        ("the SP3 orbits", &products.sp3),
        ("the clock file", &products.clock),
        ("the bias file", &products.bias),
        ("the ionosphere map", &products.ionex),
        ("the navigation file", &products.navigation),
    ] {
        inputs.extend(paths.iter().map(|path| Named::new(what, path)));
    }
    for source in &session.settings.corrections.sources {
        if let CorrectionSource::File(path) = source {
            inputs.push(Named::new("a source of corrections", path));
        }
    }
    for phone in &session.phones {
        let what = format!("the observations of {}", phone.name);
        inputs.extend(phone.observations.iter().map(|path| Named::new(&what, path)));
    }
    inputs
}

/// The files that a live hub reads: the others are the agents'.
pub fn live_inputs(file: &Path, session: &Session) -> Vec<Named> {
    let truth = |phone: &crate::session::SessionPhone| {
        Some(Named::new(&format!("the truth of {}", phone.name), phone.truth.as_deref()?))
    };
    let session_file = Named::new("the session file", file);
    std::iter::once(session_file).chain(session.phones.iter().filter_map(truth)).collect()
}
