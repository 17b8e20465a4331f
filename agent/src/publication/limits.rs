//! Limits of what the other side of a connection may use up. Zenoh's defaults are for other uses: a message may have 1 GiB there.

/// For an agent: the hub is all that it connects to.
pub(super) const AGENT_LIMITS: &[(&str, &str)] = &[
    MESSAGE_BYTES,
    NO_ADMINISTRATION,
    ("transport/unicast/max_sessions", "4"),
    ("transport/unicast/accept_pending", "1"),
];

/// For a hub. An idle stranger occupies a place among the pending connections until the time for its beginning is over, and the system queues those who come meanwhile; whoever
/// has passed the certificates occupies a session.
pub(super) const HUB_LIMITS: &[(&str, &str)] = &[
    MESSAGE_BYTES,
    NO_ADMINISTRATION,
    ("transport/unicast/max_sessions", "4096"),
    ("transport/unicast/accept_pending", "512"),
    ("transport/unicast/accept_timeout", "5000"),
];

/// For a hub whose phones are others': one that asks and does not take the answers holds up a thread of the hub for a second, not for Zenoh's five, and is then
/// disconnected.
pub(super) const GUARDED_LIMITS: &[(&str, &str)] =
    &[("transport/link/tx/queue/congestion_control/block/wait_before_close", "1000000")];

/// Twice the longest message of the wire, so that one that is too long is still counted by name.
const MESSAGE_BYTES: (&str, &str) = ("transport/link/rx/max_message_size", "524288");
/// Nobody reads or changes the configuration over the network.
const NO_ADMINISTRATION: (&str, &str) = ("adminspace/enabled", "false");

#[cfg(test)]
mod tests {
    use cofix_common::wire::MAXIMUM_MESSAGE_BYTES;

    use super::*;

    #[test]
    fn every_message_of_the_wire_passes_with_room_to_spare() {
        assert_eq!(MESSAGE_BYTES.1.parse(), Ok(2 * MAXIMUM_MESSAGE_BYTES));
    }
}
