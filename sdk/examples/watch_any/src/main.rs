//! Prints what comes on the bus as JSON lines: watch-any KEY ROUTER, as in 'noctule/@v1/attic/**' tcp/127.0.0.1:7447.
//! It has none of Noctule's code: each message names its type in its encoding, and the bus gives out the schema.

use prost_reflect::{DescriptorPool, DynamicMessage};
use std::{collections::HashMap, error::Error, io::Write, time::Duration};
use zenoh::{Config, Session, Wait};

type Result<T> = std::result::Result<T, Box<dyn Error + Send + Sync>>;

fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [key, router] = arguments.as_slice() else {
        return Err("usage: watch-any KEY ROUTER".into());
    };
    let session = zenoh::open(client_of(router)?).wait()?;
    let subscriber = session.declare_subscriber(key).wait()?;
    let mut schemas: HashMap<String, DescriptorPool> = HashMap::new();
    while let Ok(sample) = subscriber.recv() {
        // "application/protobuf;noctule.v1.Sweep"
        let encoding = sample.encoding().to_string();
        let Some(("application/protobuf", name)) = encoding.split_once(';') else {
            continue;
        };
        if !schemas.contains_key(name) {
            schemas.insert(name.to_string(), schema(&session, name)?);
        }
        let described = schemas[name].get_message_by_name(name).ok_or("the schema lacks its own message")?;
        let message = DynamicMessage::decode(described, sample.payload().to_bytes().as_ref())?;
        let line = serde_json::json!({"key": sample.key_expr().as_str(), "message": name, "value": message});
        let mut out = std::io::stdout();
        writeln!(out, "{line}")?;
        out.flush()?;
    }
    Ok(())
}

fn client_of(router: &str) -> Result<Config> {
    let mut config = Config::default();
    config.insert_json5("mode", "\"client\"")?;
    config.insert_json5("connect/endpoints", &serde_json::json!([router]).to_string())?;
    config.insert_json5("scouting/multicast/enabled", "false")?;
    Ok(config)
}

/// Ask the bus how a message is laid out; the reply is a google.protobuf.FileDescriptorSet.
fn schema(session: &Session, name: &str) -> Result<DescriptorPool> {
    let key = format!("noctule/@v1/@schema/{name}");
    let replies = session.get(&key).timeout(Duration::from_secs(5)).wait()?;
    while let Ok(reply) = replies.recv() {
        if let Ok(sample) = reply.result() {
            return Ok(DescriptorPool::decode(sample.payload().to_bytes().as_ref())?);
        }
    }
    Err(format!("nobody on the bus knows the schema of {name}").into())
}
