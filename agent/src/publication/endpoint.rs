//! Zenoh endpoints as users write them.

use std::net::IpAddr;

use super::link::LinkError;

/// How bytes are carried.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Transport {
    /// As they are.
    Tcp,
    /// In TLS.
    Tls,
}

/// The transport of sides with or without credentials.
pub(super) const fn plain_or_secured(is_secured: bool) -> Transport {
    if is_secured { Transport::Tls } else { Transport::Tcp }
}

impl Transport {
    /// The beginning of its endpoints, what is wrong with others, and an example.
    const fn words(self) -> (&'static str, &'static str, &'static str) {
        match self {
            Self::Tcp => (
                "tcp/",
                "it does not begin with tcp/, the only transport without certificates",
                "tcp/127.0.0.1:7447",
            ),
            Self::Tls => (
                "tls/",
                "it does not begin with tls/, the only transport with certificates",
                "tls/192.168.1.5:7447",
            ),
        }
    }
}

/// Whether all endpoints are of a transport, with a host and a port from `first_port` on.
///
/// # Errors
/// [`LinkError::Endpoint`] for the first that is not, or when there is none.
pub(super) fn check(endpoints: &[String], transport: Transport, first_port: u16) -> Result<(), LinkError> {
    let wrong = |endpoint: &str, reason: &str| {
        let (endpoints, reason) = (endpoint.to_owned(), reason.to_owned());
        LinkError::Endpoint { endpoints, reason, example: transport.words().2 }
    };
    if endpoints.is_empty() {
        return Err(wrong("(none)", "none is given"));
    }
    for endpoint in endpoints {
        check_one(endpoint, transport, first_port).map_err(|reason| wrong(endpoint, reason))?;
    }
    Ok(())
}

fn check_one(endpoint: &str, transport: Transport, first_port: u16) -> Result<(), &'static str> {
    let (prefix, reason, _) = transport.words();
    let address = endpoint.strip_prefix(prefix).ok_or(reason)?;
    let (_, port) = host_and_port(without_options(address))?;
    if port >= first_port { Ok(()) } else { Err(NO_PORT_NUMBER) }
}

const NO_PORT_NUMBER: &str = "its port is not a number up to 65535";

/// Zenoh's own options may follow an address.
fn without_options(address: &str) -> &str {
    address.split(['?', '#']).next().unwrap_or_default()
}

/// The host (an IPv6 address without its brackets) and the port of `HOST:PORT`.
///
/// # Errors
/// What is wrong with it.
pub fn host_and_port(address: &str) -> Result<(&str, u16), &'static str> {
    let (host, port) = address.rsplit_once(':').ok_or("there is no port")?;
    let in_brackets = host.strip_prefix('[').and_then(|host| host.strip_suffix(']'));
    if host.is_empty() || (host.contains(':') && in_brackets.is_none()) {
        return Err("there is no host before the port (IPv6 addresses are written in brackets)");
    }
    let port = port.parse().map_err(|_| NO_PORT_NUMBER)?;
    Ok((in_brackets.unwrap_or(host), port))
}

/// Zenoh's endpoints in TLS at addresses `HOST:PORT`.
pub fn secured_endpoints(addresses: &[String]) -> Vec<String> {
    addresses.iter().map(|address| format!("tls/{address}")).collect()
}

/// Whether only this computer reaches an endpoint.
pub fn is_on_loopback(endpoint: &str) -> bool {
    let address = endpoint.split_once('/').map_or(endpoint, |(_, address)| address);
    host_and_port(without_options(address)).is_ok_and(|(host, _)| {
        host == "localhost" || host.parse::<IpAddr>().is_ok_and(|address| address.is_loopback())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn endpoints_that_are_none_are_refused_with_a_reason() {
        for (endpoint, said) in [
            ("", "does not begin with tcp/"),
            ("nonsense", "does not begin with tcp/"),
            ("127.0.0.1:7447", "does not begin with tcp/"),
            ("tls/127.0.0.1:7447", "does not begin with tcp/"),
            ("tcp/", "no port"),
            ("tcp/127.0.0.1", "no port"),
            ("tcp/:7447", "no host"),
            ("tcp/::1:7447", "no host"),
            ("tcp/host:x", "not a number"),
            ("tcp/host:65536", "not a number"),
            ("tcp/host:", "not a number"),
        ] {
            let error = check(&[endpoint.to_owned()], Transport::Tcp, 0).unwrap_err().to_string();
            assert!(error.starts_with(&format!("endpoint '{endpoint}': ")), "{error}");
            assert!(
                error.contains(said) && error.ends_with("write for example tcp/127.0.0.1:7447"),
                "{error}"
            );
        }
        for endpoint in ["tcp/127.0.0.1:0", "tcp/[::1]:7447", "tcp/hub.example:7447#iface=eth0"] {
            check(&[endpoint.to_owned()], Transport::Tcp, 0).unwrap();
        }
        assert!(
            check(&["tcp/127.0.0.1:0".to_owned()], Transport::Tcp, 1).is_err(),
            "nothing answers on port 0"
        );
        check(&["tls/127.0.0.1:0".to_owned()], Transport::Tls, 0).unwrap();
        let error = check(&["tcp/127.0.0.1:0".to_owned()], Transport::Tls, 0).unwrap_err().to_string();
        assert!(error.contains("does not begin with tls/"), "{error}");
        assert!(check(&[], Transport::Tcp, 0).is_err());
    }

    #[test]
    fn loopback_is_what_no_other_computer_reaches() {
        for endpoint in ["tcp/127.0.0.1:0", "tcp/127.9.0.1:7447", "tcp/[::1]:7447", "tcp/localhost:1?x=y"] {
            assert!(is_on_loopback(endpoint), "{endpoint}");
        }
        for endpoint in
            ["tcp/0.0.0.0:7447", "tcp/[::]:7447", "tcp/192.168.1.5:7447", "tcp/hub.example:7447", "tcp/", ""]
        {
            assert!(!is_on_loopback(endpoint), "{endpoint}");
        }
    }
}
