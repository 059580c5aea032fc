//! The size of the stack, which `build` finds by the calls of a module that was linked with the usual one.

fn main() {
    println!("cargo:rerun-if-env-changed=WETCLUTCH_STACK_BYTES");
    if let Ok(bytes) = std::env::var("WETCLUTCH_STACK_BYTES") {
        println!("cargo:rustc-link-arg=-zstack-size={bytes}");
    }
}
