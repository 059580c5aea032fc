//! Bus logs of PCAN, SavvyCAN and python-can, parameter groups of J1939, and DBC files with long names and impossible signals.

use crate::common::{Folder, channel, read, with_dbc};
use logs::{OpenOptions, Quality};

const DATA: &str = "40 0C 00 00 00 00 00 00";

/// Times and values of `N_Eng` in a log with frames 0x100, and what was met.
fn engine(text: &str) -> (String, Vec<(f64, f64)>, Vec<String>) {
    let folder = Folder::new("bus-format");
    let (log, samples, notes) = read(&folder.write("bus.log", text), &with_dbc()).unwrap();
    let values = channel(&log, &samples, "N_Eng");
    (log.format(), values.into_iter().map(|(time_s, value, _)| (time_s, value)).collect(), notes)
}

#[test]
fn pcan_traces_of_all_versions_give_the_same_frames() {
    let head =
        |version: &str| format!(";$FILEVERSION={version}\n;$STARTTIME=43008.92\n;\n;   Start time: 30.09.2017\n");
    let traces = [
        (
            ";##########################\n;   C:\\x.trc\n;   PCAN-Net: TestNet\n;---+--   ----+----\n".to_owned(),
            "     1)      1000  0100  8  DATA\n     2)      1500  0100  8  RTR\n     3)      2000  0100  8  DATA\n",
        ),
        (
            head("1.1"),
            "     1)      1000.0  Rx         0100  8  DATA\n     2)      1200.0  Warng  FFFFFFFF  4  00 00 00 08 BUSHEAVY\n     3)      2000.0  Tx         0100  8  DATA\n",
        ),
        (
            head("1.2"),
            "     1)      1000.000 1  Rx         0100  8  DATA\n     2)      2000.000 1  Rx         0100  8  DATA\n",
        ),
        (
            head("1.3"),
            "     1)      1000.000 1  Rx        0100 -  8    DATA\n     2)      2000.000 1  Rx        0100 -  8    DATA\n",
        ),
        (
            head("2.0") + ";$COLUMNS=N,O,T,I,d,l,D\n",
            "      1      1000.000 DT     0100 Rx 8  DATA\n      2      1500.000 ST          Rx    00 00 00 08\n      3      2000.000 FB     0100 Rx 8  DATA\n",
        ),
        (
            head("2.1") + ";$COLUMNS=N,O,T,B,I,d,R,L,D\n",
            "      1      1000.000 DT 1      0100 Rx -  8    DATA\n      2      1500.000 RR 1      0100 Rx -  8\n      3      2000.000 FD 1      0100 Rx -  8    DATA\n",
        ),
    ];
    for (head, lines) in traces {
        let text = head + &lines.replace("DATA", DATA);
        let (format, values, notes) = engine(&text);
        assert_eq!((&*format, notes), ("CAN log (PCAN trace)", vec![]), "{text}");
        assert_eq!(values.iter().map(|(time_s, _)| *time_s).collect::<Vec<_>>(), [1.0, 2.0], "{text}");
        assert_eq!(values[0].1, values[1].1, "{text}");
    }
    // A line that is none is counted, and an extended identifier has eight digits.
    let (_, values, notes) = engine(
        &(head("1.1")
            + "     1)      1.0  Rx         0100  8  40 0C\n     2)  2.0  Rx  0100  8  40 0C 00 00 00 00 00 00\n     3)  3.0  Rx  00000100  8  40 0C 00 00 00 00 00 00\n"),
    );
    assert_eq!(values.len(), 1);
    assert!(
        notes[0].starts_with("1 lines are no frames") || notes[1].starts_with("1 lines are no frames"),
        "{notes:?}"
    );
}

#[test]
fn tables_of_frames_of_savvycan_are_read() {
    let rows = |head: &str, dir: &str| {
        let cells = DATA.replace(' ', ",");
        let row = |time_us: u32| format!("{time_us},00000100,false,{dir}0,8,{cells},\n");
        format!("{head}\n{}{}", row(1_000_000), row(2_000_000))
    };
    for text in [
        rows("Time Stamp,ID,Extended,Dir,Bus,LEN,D1,D2,D3,D4,D5,D6,D7,D8", "Rx,"),
        rows("Time Stamp,ID,Extended,Bus,LEN,D1,D2,D3,D4,D5,D6,D7,D8", ""),
    ] {
        let (format, values, notes) = engine(&text);
        assert_eq!((&*format, notes), ("CAN log (SavvyCAN)", vec![]), "{text}");
        assert_eq!(values.iter().map(|(time_s, _)| *time_s).collect::<Vec<_>>(), [1.0, 2.0]);
    }
    let folder = Folder::new("savvy-wrong");
    let wrong = "Time Stamp,ID,Extended,Dir,Bus,LEN,D1\nx,y,z,Rx,0,8,1\n";
    let error = read(&folder.write("bus.csv", wrong), &with_dbc()).map(drop).unwrap_err().to_string();
    assert!(error.contains("line 2: `x,y,z,Rx,0,8,1`"), "{error}");
}

#[test]
fn tables_of_frames_of_python_can_are_read() {
    // The data of all frames of a test is 40 0C and six zeros.
    let head = "timestamp,arbitration_id,extended,remote,error,dlc,data\n";
    let rows =
        "1.0,0x100,0,0,0,8,QAwAAAAAAAA=\n1.2,0x100,0,1,0,8,\n1.4,0x4,0,0,1,0,\n2.0,0x100,0,0,0,8,QAwAAAAAAAA=\r\n\n";
    let (format, values, notes) = engine(&format!("{head}{rows}"));
    assert_eq!((&*format, notes), ("CAN log (python-can)", vec![]));
    assert_eq!(values, [(1.0, values[0].1), (2.0, values[0].1)]);
    assert_eq!(values[0].1, 0.25 * f64::from(0x0c40));
    let folder = Folder::new("python-can-wrong");
    for wrong in
        ["1.0,0x100,0,0,0,8,QAw=", "x,0x100,0,0,0,2,QAw=", "1.0,0x100,2,0,0,2,QAw=", "1.0,0x100,0,0,0,2,Q*w=", "1.0"]
    {
        let log = folder.write("bus.csv", format!("{head}{wrong}\n"));
        let error = read(&log, &with_dbc()).map(drop).unwrap_err().to_string();
        assert!(error.contains(&format!("line 2: `{wrong}`")), "{error}");
    }
}

#[test]
fn a_classic_frame_with_a_length_code_above_eight_has_eight_bytes_in_every_format() {
    let cells = DATA.replace(' ', ",");
    for code in [9, 11, 15] {
        let logs = [
            format!(
                ";$FILEVERSION=2.1\n;$COLUMNS=N,O,T,B,I,d,R,L,D\n      1   1000.000 DT 1 0100 Rx - {code} {DATA}\n"
            ),
            format!(";$FILEVERSION=1.1\n     1)   1000.0  Rx   0100  {code}  {DATA}\n"),
            format!(
                "Time Stamp,ID,Extended,Dir,Bus,LEN,D1,D2,D3,D4,D5,D6,D7,D8\n1000000,00000100,false,Rx,0,{code},{cells},\n"
            ),
            format!("timestamp,arbitration_id,extended,remote,error,dlc,data\n1.0,0x100,0,0,0,{code},QAwAAAAAAAA=\n"),
        ];
        for log in logs {
            let (_, values, notes) = engine(&log);
            assert_eq!((values, notes), (vec![(1.0, 0.25 * f64::from(0x0c40))], vec![]), "{log}");
        }
    }
}

/// 64 bytes with their length code in place of their length.
#[test]
fn a_frame_of_can_fd_may_have_its_length_code() {
    let more = |count: usize, with: &str| vec!["00"; count].join(with);
    let base64 = format!("QAwA{}AA==", "A".repeat(80));
    for code in [15, 64] {
        let logs = [
            format!(
                ";$FILEVERSION=2.1\n;$COLUMNS=N,O,T,B,I,d,R,l,D\n 1 1000.000 FD 1 0100 Rx - {code} {DATA} {}\n",
                more(56, " ")
            ),
            format!(
                "Time Stamp,ID,Extended,Dir,Bus,LEN,D1,D2,D3,D4,D5,D6,D7,D8\n1000000,00000100,false,Rx,0,{code},{},{},\n",
                DATA.replace(' ', ","),
                more(56, ",")
            ),
            format!("timestamp,arbitration_id,extended,remote,error,dlc,data\n1.0,0x100,0,0,0,{code},{base64}\n"),
        ];
        for log in logs {
            let (_, values, notes) = engine(&log);
            assert_eq!((values, notes), (vec![(1.0, 0.25 * f64::from(0x0c40))], vec![]), "{log}");
        }
    }
}

/// A DBC of J1939: engine speed of EEC1, both shaft speeds of ETC1.
const J1939: &str = "VERSION \"\"\n\nBU_: A\n\nBO_ 2364540158 EEC1: 8 A\n SG_ EngSpeed : 24|16@1+ (0.125,0) [0|8031.875] \"rpm\" A\n\n\
    BO_ 2364539646 ETC1: 8 A\n SG_ TransOutputShaftSpeed : 8|16@1+ (0.125,0) [0|8031.875] \"rpm\" A\n SG_ TransInputShaftSpeed : 40|16@1+ (0.125,0) [0|8031.875] \"rpm\" A\n";

#[test]
fn parameter_groups_of_j1939_are_found_whatever_priority_and_source_are() {
    let folder = Folder::new("j1939");
    let options = |dbc: &str| OpenOptions { dbc: Some(folder.write("j1939.dbc", dbc)), ..OpenOptions::default() };
    // EEC1 of the engine with another priority, of a second control unit, and with a value that is not available; ETC1 of the gearbox.
    let log = "(1.0) can0 18F00400#FFFFFF803EFFFFFF\n(1.1) can0 0CF00417#FFFFFF0000FFFFFF\n(1.2) can0 18F00400#FFFFFFFFFEFFFFFF\n\
        (1.3) can0 0CF00203#FF401FFFFF8025FF\n(1.4) can0 18FEF100#0000000000000000\n";
    let log = folder.write("truck.log", log);
    let (found, samples, notes) = read(&log, &options(J1939)).unwrap();
    assert_eq!(channel(&found, &samples, "EngSpeed")[0], (1.0, 2000.0, Quality::Good));
    let engine: Vec<Quality> =
        channel(&found, &samples, "EngSpeed").into_iter().map(|(_, _, quality)| quality).collect();
    assert_eq!(engine, [Quality::Good, Quality::Missing]);
    assert_eq!(channel(&found, &samples, "TransOutputShaftSpeed")[0].1, 1000.0);
    assert_eq!(channel(&found, &samples, "TransInputShaftSpeed")[0].1, 1200.0);
    assert!(
        notes.iter().any(|note| note
            .starts_with("parameter group 61444 comes from several control units: that of the first one, 0x00")),
        "{notes:?}"
    );
    assert!(
        notes.iter().any(|note| note.starts_with("1 of 5 frames, of 1 identifiers, are not in the DBC: 0x18FEF100")),
        "{notes:?}"
    );
    let suggested = logs::suggest(found.channels(), &[], None);
    for (role, name) in [
        ("engine_speed", "EngSpeed"),
        ("output_speed", "TransOutputShaftSpeed"),
        ("turbine_speed", "TransInputShaftSpeed"),
    ] {
        assert!(suggested.contains(&format!("[channel.{role}]\nname = \"{name}\"")), "{role}: {suggested}");
    }
    // With a source in the identifiers, the DBC must say that it is of J1939: as a protocol, or of the message.
    let of_source = J1939.replace("2364540158", "2364539904").replace("2364539646", "2364539395");
    let frames = folder.write("other.log", "(1.0) can0 18F00417#FFFFFF803EFFFFFF\n");
    let count = |dbc: &str| {
        let (found, samples, _) = read(&frames, &options(dbc)).unwrap();
        channel(&found, &samples, "EngSpeed").len()
    };
    let protocol =
        "BA_DEF_  \"ProtocolType\" STRING ;\nBA_DEF_DEF_  \"ProtocolType\" \"\";\nBA_ \"ProtocolType\" \"J1939\";\n";
    let format = "BA_DEF_ BO_  \"VFrameFormat\" ENUM  \"StandardCAN\",\"ExtendedCAN\",\"reserved\",\"J1939PG\";\nBA_DEF_DEF_  \"VFrameFormat\" \"ExtendedCAN\";\nBA_ \"VFrameFormat\" BO_ 2364539904 3;\n";
    assert_eq!(
        [&of_source, &format!("{of_source}\n{protocol}"), &format!("{of_source}\n{format}")].map(|dbc| count(dbc)),
        [0, 1, 1]
    );
}

#[test]
fn long_names_of_a_dbc_are_the_names_and_an_impossible_signal_leaves_the_others() {
    let folder = Folder::new("long-names");
    let dbc = "VERSION \"\"\n\nBU_: A\n\nBO_ 256 X: 16 A\n SG_ Mux M : 0|8@1+ (1,0) [0|0] \"\" A\n SG_ Serial m1 : 8|72@1+ (1,0) [0|0] \"\" A\n\
        SG_ TransmissionInputShaftSpeedOfTh_ m1 : 8|16@1+ (1,0) [0|0] \"rpm\" A\n\n\
        BA_DEF_ SG_  \"SystemSignalLongSymbol\" STRING ;\nBA_DEF_DEF_  \"SystemSignalLongSymbol\" \"\";\n\
        BA_ \"SystemSignalLongSymbol\" SG_ 256 TransmissionInputShaftSpeedOfTh_ \"TransmissionInputShaftSpeedOfTheGearbox\";\n";
    let dbc = dbc.replace("\nSG_", "\n SG_");
    let options = OpenOptions { dbc: Some(folder.write("long.dbc", &dbc)), ..OpenOptions::default() };
    let (log, samples, notes) =
        read(&folder.write("bus.log", "(1.0) can0 100#01E803\n(2.0) can0 100#02E803\n"), &options).unwrap();
    assert_eq!(channel(&log, &samples, "TransmissionInputShaftSpeedOfTheGearbox"), [(1.0, 1000.0, Quality::Good)]);
    assert_eq!(log.channels().len(), 2);
    assert_eq!(
        notes,
        ["signal `Serial` of message `X` has 72 bits from bit 8, expected 1 to 64 within 64 bytes: it is left out"]
    );
}
