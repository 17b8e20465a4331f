//! The header line of a log that names the phone: `# Version: v3.0.6.4 Platform: 14 Manufacturer: Google Model: Pixel 7`.

/// Names of the line's values.
const NAMES: [&str; 4] = ["Version:", "Platform:", "Manufacturer:", "Model:"];

/// Phone and app of a log. Texts are empty where the log does not tell.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Device {
    app_version: String,
    /// Version of Android.
    platform: String,
    manufacturer: String,
    model: String,
}

impl Device {
    /// Reads a comment without its `#`; `None` when it names neither manufacturer nor model.
    pub(super) fn of(comment: &str) -> Option<Self> {
        let [app_version, platform, manufacturer, model] = NAMES.map(|name| value(comment, name));
        let device = Self { app_version, platform, manufacturer, model };
        (!device.manufacturer.is_empty() || !device.model.is_empty()).then_some(device)
    }

    /// Manufacturer and model, the manufacturer once.
    pub(super) fn name(&self) -> String {
        let Self { manufacturer, model, .. } = self;
        let is_named = model.to_lowercase().starts_with(&manufacturer.to_lowercase());
        let name = if is_named { model.clone() } else { format!("{manufacturer} {model}") };
        name.trim().to_owned()
    }

    /// Versions of Android and of the app, as far as they are known.
    pub(super) fn software(&self) -> String {
        let platform =
            if self.platform.is_empty() { String::new() } else { format!("Android {}", self.platform) };
        format!("{platform} {}", self.app_version).trim().to_owned()
    }
}

/// The text from a name to the next one.
fn value(comment: &str, name: &str) -> String {
    let Some((_, rest)) = comment.split_once(name) else { return String::new() };
    let end = NAMES.iter().filter_map(|next| rest.find(next)).min().unwrap_or(rest.len());
    let text: String = rest.get(..end).unwrap_or_default().chars().filter(|c| !c.is_control()).collect();
    text.trim().to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_phone_is_named_by_its_line() {
        let device =
            Device::of("Version: v3.0.6.4 Platform: 14 Manufacturer: Example Model: Phone 7 Pro").unwrap();
        assert_eq!(
            (device.name().as_str(), device.software().as_str()),
            ("Example Phone 7 Pro", "Android 14 v3.0.6.4")
        );
        let once =
            Device::of("Version: 1.4.0.0, Platform: N Manufacturer: HUAWEI Model: HUAWEI P30").unwrap();
        assert_eq!(once.name(), "HUAWEI P30");
        let model = Device::of("Model: X").unwrap();
        assert_eq!((model.name().as_str(), model.software().as_str()), ("X", ""));
        for comment in ["", "Header Description:", "Version: 3", "Manufacturer: Model:"] {
            assert_eq!(Device::of(comment), None, "{comment}");
        }
    }
}
