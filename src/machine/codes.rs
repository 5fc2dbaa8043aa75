//! What the error and alarm numbers of GRBL-type boards mean.

/// Text and, where it helps, what to do, per `error:N` of GRBL 1.1 (1–38) and grblHAL and FluidNC beyond.
const ERRORS: &[(u16, &str)] = &[
    (1, "a word has no letter"),
    (2, "a number is missing or malformed"),
    (3, "the `$` command is not known"),
    (4, "a value must not be negative"),
    (5, "homing is switched off in the board ($22=0)"),
    (6, "the step pulse is too short"),
    (7, "the settings in the board's memory could not be read; defaults are in force"),
    (8, "this `$` command needs an idle machine"),
    (9, "the machine is locked by an alarm or busy jogging; home it ($H) or unlock it ($X)"),
    (10, "soft limits need homing ($20=1 without $22=1)"),
    (11, "the line is too long for the board"),
    (12, "a step rate would be too high"),
    (13, "the safety door is open"),
    (14, "the start-up line or build information is too long"),
    (15, "a jog would leave the travel"),
    (16, "a jog command lacks `=` or holds forbidden words"),
    (17, "laser mode needs a PWM output"),
    (18, "the home switch state is wrong"),
    (20, "the board does not know this G or M word"),
    (21, "two words of one modal group in a line"),
    (22, "no feed rate has been set"),
    (23, "a word needs a whole number"),
    (24, "two words that both use the axis letters"),
    (25, "a word appears twice"),
    (26, "a word that needs axis letters has none"),
    (27, "the line number is out of range"),
    (28, "a word lacks its P or L value"),
    (29, "only G54 to G59 exist"),
    (30, "G53 works with G0 and G1 only"),
    (31, "axis letters without a word that uses them"),
    (32, "an arc has no axis letter in its plane"),
    (33, "the end of the arc or probe move does not fit"),
    (34, "the radius of the arc does not fit its ends"),
    (35, "an arc lacks its centre"),
    (36, "words that nothing uses"),
    (37, "the tool length offset belongs to another axis"),
    (38, "the tool number is too large"),
    (39, "a value is out of range"),
    (40, "the machine waits for a tool change"),
    (41, "spindle commands are refused here"),
    (42, "tool change needs homing"),
    (43, "the machine is not homed"),
    (46, "home the machine first"),
    (50, "an emergency stop is active"),
    (51, "motor fault"),
    (60, "the storage could not be mounted"),
    (61, "the file could not be read"),
    (62, "the folder could not be read"),
    (70, "bluetooth could not be started"),
    (79, "the machine stands at a limit switch"),
    (152, "the board's configuration is invalid"),
];

/// Text per `ALARM:N`.
const ALARMS: &[(u16, &str)] = &[
    (1, "a limit switch was hit; the position is lost"),
    (2, "the move would leave the travel (soft limit)"),
    (3, "it was reset while moving; the position is lost"),
    (4, "the probe was touching before it should"),
    (5, "the probe found nothing"),
    (6, "homing was interrupted by a reset"),
    (7, "homing was interrupted by the door"),
    (8, "homing could not leave the switch; raise $27"),
    (9, "homing did not find the switch; check $130 to $132 and the wiring"),
    (10, "homing of a second motor failed"),
    (11, "home the machine first"),
    (12, "a limit switch is held"),
    (13, "the probe is held"),
    (14, "spindle fault"),
    (15, "an input that homing needs is held"),
    (16, "emergency stop"),
    (17, "motor fault"),
];

fn lookup(table: &'static [(u16, &'static str)], code: u16) -> &'static str {
    table.iter().find(|it| it.0 == code).map_or("no text is known for this number; see the board's manual", |it| it.1)
}

/// What `error:code` means.
pub fn error(code: u16) -> &'static str {
    lookup(ERRORS, code)
}

/// What `ALARM:code` means.
pub fn alarm(code: u16) -> &'static str {
    lookup(ALARMS, code)
}
