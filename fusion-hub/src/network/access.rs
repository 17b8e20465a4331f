//! Zenoh's access control for the phones of a group: whatever is not allowed here is denied.
//!
//! | who asks | what | on which keys of the phone |
//! |:--|:--|:--|
//! | phone | puts | `epoch`, `status` |
//! | phone | liveliness token | `alive` |
//! | phone | queryable, replies | `history` |
//! | phone | queries | `receipt`, `pace` |
//! | phone | subscribes | its fused states; those of the group and `integrity` if they are shared |
//! | hub | queries | `history` |
//! | hub | replies | `receipt`, `pace` |
//! | hub | puts | what the phone may subscribe to |
//!
//! Whoever holds the hub's own certificate may query `status` of the group, and nothing else.
//!
//! The hub's own subscriptions and queryables are told to phones as they are, for all phones. Rules bind messages that come from a session
//! or go to one (ingress, egress, as Zenoh has it); what the hub does in its own session is bound by none.

use cofix_common::wire::{
    KeyNameError, all_epochs_key, all_fused_key, all_paces_key, all_receipts_key, all_status_key, epoch_key,
    fused_key, history_key, hub_status_key, integrity_key, liveliness_key, pace_key, receipt_key, status_key,
};
use serde_json::{Value, json};

use crate::enroll::Register;

/// Zenoh's setting `access_control` for the phones of a register, and for the holder of the hub's certificate.
///
/// # Errors
/// When a name cannot be part of a key.
pub fn access_control(register: &Register, share_fused: bool) -> Result<Value, KeyNameError> {
    let group = &register.group;
    let (mut rules, mut subjects, mut policies) = (Vec::new(), Vec::new(), Vec::new());
    for (rank, member) in register.phones.iter().enumerate() {
        let own = of_phone(group, &member.name, share_fused, rank)?;
        let ids: Vec<&Value> = own.iter().filter_map(|rule| rule.get("id")).collect();
        let subject = format!("phone-{rank}");
        subjects.push(json!({ "id": subject, "cert_common_names": [member.certificate] }));
        policies.push(json!({ "id": subject, "rules": ids, "subjects": [subject] }));
        rules.extend(own);
    }
    if let Some(certificate) = &register.hub_certificate {
        let status = vec![hub_status_key(group)?];
        let own = [
            rule("hub", "ingress", &["query"], &status),
            rule("hub", "egress", &["reply", "declare_queryable"], &status),
        ];
        let ids: Vec<&Value> = own.iter().filter_map(|rule| rule.get("id")).collect();
        subjects.push(json!({ "id": "hub", "cert_common_names": [certificate] }));
        policies.push(json!({ "id": "hub", "rules": ids, "subjects": ["hub"] }));
        rules.extend(own);
    }
    Ok(json!({
        "enabled": true,
        "default_permission": "deny",
        "rules": rules,
        "subjects": subjects,
        "policies": policies,
    }))
}

/// Allows messages on some keys.
fn rule(whose: &str, flow: &str, messages: &[&str], keys: &[String]) -> Value {
    json!({
        "id": format!("{whose}-{flow}-{}", messages.join("-")),
        "messages": messages,
        "flows": [flow],
        "permission": "allow",
        "key_exprs": keys,
    })
}

/// The rules of one phone.
fn of_phone(group: &str, phone: &str, share_fused: bool, rank: usize) -> Result<Vec<Value>, KeyNameError> {
    let history = history_key(group, phone)?;
    let (epoch, status) = (epoch_key(group, phone)?, status_key(group, phone)?);
    let (receipt, pace) = (receipt_key(group, phone)?, pace_key(group, phone)?);
    let readable = if share_fused {
        vec![all_fused_key(group)?, integrity_key(group)?]
    } else {
        vec![fused_key(group, phone)?]
    };
    let whose = rank.to_string();
    let rule = |flow: &str, messages: &[&str], keys: Vec<String>| rule(&whose, flow, messages, &keys);
    Ok(vec![
        rule("ingress", &["put"], vec![epoch.clone(), status.clone()]),
        rule("ingress", &["liveliness_token"], vec![liveliness_key(group, phone)?]),
        rule("ingress", &["declare_queryable", "reply"], vec![history.clone()]),
        rule("ingress", &["query"], vec![receipt.clone(), pace.clone()]),
        rule("ingress", &["declare_subscriber"], readable.clone()),
        rule("egress", &["put"], readable),
        rule("egress", &["query"], vec![history]),
        rule("egress", &["reply"], vec![receipt, pace]),
        rule("egress", &["declare_subscriber"], vec![all_epochs_key(group)?, all_status_key(group)?]),
        rule("egress", &["declare_queryable"], vec![all_receipts_key(group)?, all_paces_key(group)?]),
    ])
}
