//! The C of each instruction does what WebAssembly does: results against those of Rust, with a compiler of C at two levels.

use std::fmt::Write as _;
use std::process::Command;

use c99::{Documentation, translate};

use crate::module::{F32, Function, I32, I64, constant, module};

const WORDS: [u32; 12] = [0, 1, 2, 31, 32, 33, 127, 128, 0x7fff_ffff, 0x8000_0000, 0xffff_fff0, 0xffff_ffff];
const SINGLES: [f32; 14] = [
    0.0,
    -0.0,
    1.0,
    -1.5,
    0.5,
    2.5,
    1e-40,
    3.4e38,
    -2_147_483_648.0,
    2_147_483_648.0,
    4.3e9,
    f32::INFINITY,
    f32::NEG_INFINITY,
    f32::NAN,
];

type OfWords = (&'static str, u8, fn(u32, u32) -> u32);
type OfSingles = (&'static str, u8, fn(f32, f32) -> f32);

const OF_WORDS: [OfWords; 24] = [
    ("eq", 0x46, |a, b| u32::from(a == b)),
    ("ne", 0x47, |a, b| u32::from(a != b)),
    ("lt_s", 0x48, |a, b| u32::from(a.cast_signed() < b.cast_signed())),
    ("lt_u", 0x49, |a, b| u32::from(a < b)),
    ("gt_s", 0x4a, |a, b| u32::from(a.cast_signed() > b.cast_signed())),
    ("gt_u", 0x4b, |a, b| u32::from(a > b)),
    ("le_s", 0x4c, |a, b| u32::from(a.cast_signed() <= b.cast_signed())),
    ("le_u", 0x4d, |a, b| u32::from(a <= b)),
    ("ge_s", 0x4e, |a, b| u32::from(a.cast_signed() >= b.cast_signed())),
    ("ge_u", 0x4f, |a, b| u32::from(a >= b)),
    ("add", 0x6a, u32::wrapping_add),
    ("sub", 0x6b, u32::wrapping_sub),
    ("mul", 0x6c, u32::wrapping_mul),
    ("div_u", 0x6e, |a, b| a / b.max(1)),
    ("rem_u", 0x70, |a, b| a % b.max(1)),
    ("and", 0x71, |a, b| a & b),
    ("or", 0x72, |a, b| a | b),
    ("xor", 0x73, |a, b| a ^ b),
    ("shl", 0x74, |a, b| a << (b & 31)),
    ("shr_s", 0x75, |a, b| (a.cast_signed() >> (b & 31)).cast_unsigned()),
    ("shr_u", 0x76, |a, b| a >> (b & 31)),
    ("rotl", 0x77, |a, b| a.rotate_left(b & 31)),
    ("clz", 0x67, |_, b| b.leading_zeros()),
    ("extend", 0xc0, |_, b| i32::from(b as u8 as i8).cast_unsigned()),
];

const OF_SINGLES: [OfSingles; 16] = [
    ("fadd", 0x92, |a, b| a + b),
    ("fsub", 0x93, |a, b| a - b),
    ("fmul", 0x94, |a, b| a * b),
    ("fdiv", 0x95, |a, b| a / b),
    ("fmin", 0x96, |a, b| {
        if a == b {
            f32::from_bits(a.to_bits() | b.to_bits())
        } else if a.is_nan() || b.is_nan() {
            f32::NAN
        } else {
            a.min(b)
        }
    }),
    ("fmax", 0x97, |a, b| {
        if a == b {
            f32::from_bits(a.to_bits() & b.to_bits())
        } else if a.is_nan() || b.is_nan() {
            f32::NAN
        } else {
            a.max(b)
        }
    }),
    ("copysign", 0x98, f32::copysign),
    ("fabs", 0x8b, |_, b| b.abs()),
    ("fneg", 0x8c, |_, b| -b),
    ("fceil", 0x8d, |_, b| b.ceil()),
    ("ffloor", 0x8e, |_, b| b.floor()),
    ("ftrunc", 0x8f, |_, b| b.trunc()),
    ("fsqrt", 0x91, |_, b| b.sqrt()),
    ("from_u", 0xb3, |_, b| b.to_bits() as f32),
    ("from_s", 0xb2, |_, b| b.to_bits().cast_signed() as f32),
    ("select", 0, |a, b| if a < b { a } else { b }),
];

/// Bits, where each number that is none is the same one.
fn bits(value: f32) -> u32 {
    if value.is_nan() { f32::NAN.to_bits() } else { value.to_bits() }
}

/// Calls a function in memory: stores two words of 16 bits at places that are no multiple of four, fills, copies, and sums what is there.
fn in_memory() -> Function {
    let get = |local: u8| vec![0x20, local];
    let store = |address: i32, local: u8, opcode: u8, align: u8, offset: u8| {
        [constant(address), get(local), vec![opcode, align, offset]].concat()
    };
    let load =
        |address: i32, opcode: u8, align: u8, offset: u8| [constant(address), vec![opcode, align, offset]].concat();
    let body = [
        [constant(8), constant(0), constant(40), vec![0xfc, 11, 0]].concat(), // what the call before has left
        store(4, 1, 0x36, 2, 4),                                              // i32.store at 8
        store(9, 0, 0x36, 0, 2),                                              // i32.store at 11, of bytes
        store(20, 0, 0x3b, 0, 1),                                             // i32.store16 at 21
        store(23, 1, 0x3a, 0, 1),                                             // i32.store8 at 24
        [constant(28), constant(0x5a), constant(7), vec![0xfc, 11, 0]].concat(), // memory.fill 28..35
        [constant(9), constant(8), constant(20), vec![0xfc, 10, 0, 0]].concat(), // memory.copy 8..28 to 9..29
        // A hash of the words from 8 to 36.
        constant(0),
        vec![0x21, 2],
        constant(8),
        vec![0x21, 3],
        vec![0x03, 0x40], // loop
        [get(2), constant(31), vec![0x6c], get(3), vec![0x28, 2, 0], vec![0x6a, 0x21, 2]].concat(),
        [get(3), constant(4), vec![0x6a, 0x22, 3], constant(36), vec![0x49, 0x0d, 0]].concat(), // br_if
        vec![0x0b],
        [get(2), load(9, 0x28, 0, 0), vec![0x6a], load(13, 0x2f, 0, 0), vec![0x6a], load(64, 0x2d, 0, 3), vec![0x6a]]
            .concat(),
    ]
    .concat();
    Function { locals: 2, ..Function::new("in_memory", &[I32, I32], &[I32], &body) }
}

/// The same in Rust. The constants 1 to 16 stand from 64 on.
fn in_memory_here(a: u32, b: u32) -> u32 {
    let mut m = [0_u8; 80];
    m[64..].copy_from_slice(&(1..=16).collect::<Vec<u8>>());
    m[8..12].copy_from_slice(&b.to_le_bytes());
    m[11..15].copy_from_slice(&a.to_le_bytes());
    m[21..23].copy_from_slice(&a.to_le_bytes()[..2]);
    m[24] = b as u8;
    m[28..35].fill(0x5a);
    m.copy_within(8..28, 9);
    let word = |at: usize| u32::from_le_bytes([m[at], m[at + 1], m[at + 2], m[at + 3]]);
    let sum = (8..36).step_by(4).fold(0_u32, |sum, at| sum.wrapping_mul(31).wrapping_add(word(at)));
    let half = u32::from(u16::from_le_bytes([m[13], m[14]]));
    sum.wrapping_add(word(9)).wrapping_add(half).wrapping_add(u32::from(m[67]))
}

/// A branch table into blocks, and a block with a result that is left by a condition: `10 * (a of 0..3) + (b < 5 ? b : 7)`.
fn branches() -> Function {
    let get = |local: u8| vec![0x20, local];
    let body = [
        vec![0x02, 0x40, 0x02, 0x40, 0x02, 0x40], // three blocks
        get(0),
        vec![0x0e, 3, 0, 1, 1, 2], // br_table 0 1 1, default 2
        vec![0x0b],
        [constant(10), vec![0x21, 2, 0x0c, 1]].concat(), // case 0: then leave
        vec![0x0b],
        [constant(20), vec![0x21, 2]].concat(), // cases 1 and 2
        vec![0x0b],
        vec![0x02, I32], // block with a result
        [get(1), get(1), constant(5), vec![0x49, 0x0d, 0], vec![0x1a], constant(7)].concat(),
        vec![0x0b],
        [get(2), vec![0x6a]].concat(),
    ]
    .concat();
    Function { locals: 1, ..Function::new("branches", &[I32, I32], &[I32], &body) }
}

fn branches_here(a: u32, b: u32) -> u32 {
    let of_a = match a {
        0 => 10,
        1 | 2 => 20,
        _ => 0,
    };
    of_a + if b < 5 { b } else { 7 }
}

/// `a` and `b` as one number of 64 bits: shifted, multiplied, and stored.
fn long() -> Function {
    let body = [
        constant(40),
        vec![0x20, 0, 0xad, 0x42, 32, 0x86], // a << 32
        vec![0x20, 1, 0xad, 0x84],           // | b
        vec![0x42, 3, 0x7e],                 // * 3
        vec![0x42, 1, 0x88],                 // >> 1
        vec![0x37, 2, 0],                    // i64.store with the alignment of a word
        constant(40),
        vec![0x29, 2, 0, 0xa7], // i64.load, wrapped
        constant(40),
        vec![0x28, 2, 4, 0x73], // ^ the upper word
    ]
    .concat();
    Function::new("long", &[I32, I32], &[I32], &body)
}

fn long_here(a: u32, b: u32) -> u32 {
    let value = (u64::from(a) << 32 | u64::from(b)).wrapping_mul(3) >> 1;
    value as u32 ^ (value >> 32) as u32
}

/// A signed number of an expression that is longer than a line: minus the sum of the constants and `a`, as a number of single precision.
fn long_expression() -> Function {
    let mut body = vec![0x20, 0];
    for at in 0..16 {
        body.extend([constant(64), vec![0x2d, 0, at, 0x6a]].concat());
    }
    body.extend([constant(-1), vec![0x6c, 0xb2]].concat());
    Function::new("long_expression", &[I32], &[F32], &body)
}

/// Counts from `a` down to the first number below it that has no remainder by 4. The condition of the loop is the result of a block, which
/// is 1 as well where the count is above 1000.
fn loop_until() -> Function {
    let get = |local: u8| vec![0x20, local];
    let body = [
        vec![0x03, 0x40], // loop
        [get(0), constant(1), vec![0x6b, 0x21, 0]].concat(),
        vec![0x02, I32], // block with a result
        [constant(1), get(0), constant(1000), vec![0x4b, 0x0d, 0, 0x1a]].concat(),
        [get(0), constant(3), vec![0x71]].concat(),
        vec![0x0b],
        vec![0x0d, 0, 0x0b], // again
        get(0),
    ]
    .concat();
    Function::new("loop_until", &[I32], &[I32], &body)
}

/// Shifts of 64 bits by constants beyond 32 bits.
fn long_shift() -> Function {
    let by = [0x42, 0x84, 0x80, 0x80, 0x80, 0x80, 0x20]; // 2^40 + 4
    let body = [&[0x20, 0, 0xad][..], &by, &[0x86, 0x42, 1, 0x88, 0xa7]].concat();
    Function::new("long_shift", &[I32], &[I32], &body)
}

#[test]
fn each_instruction_has_its_results_in_c() {
    let get = |local: u8| vec![0x20, local];
    let one = |name: &str| ["clz", "extend", "fabs", "fneg", "fceil", "ffloor", "ftrunc", "fsqrt"].contains(&name);
    let mut functions = vec![in_memory(), branches(), long(), long_expression(), loop_until(), long_shift()];
    for (name, opcode, _) in OF_WORDS {
        let divisor = [get(1), constant(1), get(1), vec![0x1b]].concat(); // 1 for 0
        let body = match name {
            _ if one(name) => [get(1), vec![opcode]].concat(),
            "div_u" | "rem_u" => [get(0), divisor, vec![opcode]].concat(),
            _ => [get(0), get(1), vec![opcode]].concat(),
        };
        functions.push(Function::new(name, &[I32, I32], &[I32], &body));
    }
    for (name, opcode, _) in OF_SINGLES {
        let body = match name {
            "from_u" | "from_s" => [get(1), vec![0xbc, opcode]].concat(),
            "select" => [get(0), get(1), get(0), get(1), vec![0x5d, 0x1b]].concat(),
            _ if one(name) => [get(1), vec![opcode]].concat(),
            _ => [get(0), get(1), vec![opcode]].concat(),
        };
        functions.push(Function::new(name, &[F32, F32], &[F32], &body));
    }
    functions.push(Function::new("whole", &[F32], &[I32], &[0x20, 0, 0xfc, 1]));
    functions.push(Function::new("whole_signed", &[F32], &[I32], &[0x20, 0, 0xfc, 0]));
    // A long is a parameter of nothing above.
    functions.push(Function::new("wrap", &[I64], &[I32], &[0x20, 0, 0xa7]));

    let (mut calls, mut expected) = (String::new(), String::new());
    let mut call = |text: String, result: u32| {
        let _ = writeln!(calls, "  say({text});");
        let _ = writeln!(expected, "{result:08x}");
    };
    for a in [1_u32, 2, 5, 64, 999, 1003] {
        let until = (0..a).rev().find(|count| *count <= 1000 && count % 4 == 0).unwrap_or_default();
        call(format!("inner_loop_until({a}u)"), until);
        call(format!("bits(inner_long_expression(m, {a}u))"), (-f32::from(a as u16 + 136)).to_bits());
        call(format!("inner_long_shift({:#x}u)", a << 24), ((u64::from(a << 24) << 4) >> 1) as u32);
    }
    for a in WORDS {
        for b in WORDS {
            call(format!("inner_in_memory(m, {a}u, {b}u)"), in_memory_here(a, b));
            call(format!("inner_branches({a}u, {b}u)"), branches_here(a, b));
            call(format!("inner_long(m, {a}u, {b}u)"), long_here(a, b));
            for (name, _, here) in OF_WORDS {
                call(format!("inner_{name}({a}u, {b}u)"), here(a, b));
            }
        }
    }
    for a in SINGLES {
        for b in SINGLES {
            for (name, _, here) in OF_SINGLES {
                let arguments = [a, b].map(|value| format!("single({:#x}u)", value.to_bits())).join(", ");
                call(format!("number(inner_{name}({arguments}))"), bits(here(a, b)));
            }
        }
        call(format!("inner_whole(single({:#x}u))", a.to_bits()), a as u32);
        call(format!("inner_whole_signed(single({:#x}u))", a.to_bits()), (a as i32).cast_unsigned());
    }
    call("inner_wrap(UINT64_C(0x123456789abcdef0))".to_owned(), 0x9abc_def0);

    let before = "#include <stdint.h>\n#include <stddef.h>\n#include <stdio.h>\n";
    let after = format!(
        "static uint64_t memory[(HEAP + 64u) / 8u];\nstatic void say(uint32_t value) {{ printf(\"%08x\\n\", (unsigned)value); }}\n\
         static uint32_t number(float value) {{ return value != value ? 0x7fc00000u : bits(value); }}\n\
         static void run(uint8_t *m) {{\n{calls}}}\nint main(void) {{\n  begin_memory((uint8_t *)memory);\n  run((uint8_t *)memory);\n  return 0;\n}}\n"
    );
    let text = translate(&module(&functions, 64, None), before, &after, &Documentation::default()).unwrap();
    let folder = std::env::temp_dir().join(format!("wetclutch-c99-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    std::fs::write(folder.join("all.c"), text).unwrap();
    for level in ["-O0", "-O2"] {
        let options = ["-std=c99", "-Wall", "-Wextra", "-Wconversion", "-Werror", "-ffp-contract=off", level];
        let built =
            Command::new("cc").args(options).args(["all.c", "-lm", "-o", "all"]).current_dir(&folder).output().unwrap();
        assert!(built.status.success(), "{}", String::from_utf8_lossy(&built.stderr));
        let said = Command::new(folder.join("all")).output().unwrap();
        let said = String::from_utf8(said.stdout).unwrap();
        let different = said.lines().zip(expected.lines()).position(|(said, expected)| said != expected);
        let line = different.map(|at| {
            (
                after.lines().filter(|line| line.starts_with("  say(")).nth(at),
                said.lines().nth(at),
                expected.lines().nth(at),
            )
        });
        assert_eq!((line, said.lines().count()), (None, expected.lines().count()), "{level}");
    }
    std::fs::remove_dir_all(folder).unwrap();
}
