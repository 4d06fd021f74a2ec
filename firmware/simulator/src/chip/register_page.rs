//! The table of registers as a page for people: the README holds exactly what this prints.

use super::sfr::{Register, TABLE};

/// Markdown: the modelled registers with their bits, and those without a model.
pub fn markdown() -> String {
    let mut page =
        String::from("| register | address | modelled | datasheet chapter |\n| --- | --- | --- | --- |\n");
    for register in TABLE.iter().filter(|register| register.owner.is_some()) {
        page += &row(register);
    }
    let unmodelled: Vec<&str> =
        TABLE.iter().filter(|register| register.owner.is_none()).map(|register| register.name).collect();
    page + &format!("\nWithout a model, any access being fatal: {}.\n", unmodelled.join(", "))
}

fn row(register: &Register) -> String {
    let Register { name, address, chapter, .. } = register;
    format!("| {name} | 0x{address:02X} | {} | {chapter} |\n", bits(register))
}

fn bits(register: &Register) -> String {
    if register.fields.is_empty() {
        return "only 0 may be written".to_owned();
    }
    if let [field] = register.fields
        && field.name == register.name
    {
        return "all bits".to_owned();
    }
    register.fields.iter().map(|field| field.name).collect::<Vec<_>>().join(", ")
}
