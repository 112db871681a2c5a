//! Simulated devices that render another force than the one they were sent, to show that
//! a session and `study device check` find them.
//!
//! A wrong device changes the table on its way to the servo, the motion that the servo
//! sees, or what is reported. It obeys docs/wire.md in everything else.

mod felt;
mod saboteur;

pub(super) use saboteur::Saboteur;
use study_wire::servo::ServoSettings;

macro_rules! wrongs {
    ($($name:ident $text:literal $what:literal;)+) => {
        /// A way in which a device is wrong.
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        #[allow(missing_docs, reason = "ALL has the meanings")]
        pub enum Wrong { $($name,)+ }

        impl Wrong {
            /// Each with its name on the command line and its meaning.
            pub const ALL: &[(Self, &'static str, &'static str)] =
                &[$((Self::$name, $text, $what),)+];
        }
    };
}

wrongs! {
    HalfForce "half-force" "half of the force";
    DoubleForce "double-force" "double force, clamped to the limit";
    Weak "weak" "0.85 of the force";
    Strong "strong" "1.15 of the force";
    WeakForwards "weak-forwards" "0.85 of the force for v > 0";
    SlightlyWeak "slightly-weak" "0.89 of the force";
    Reversed "reversed" "the force has the wrong sign";
    Limp "limp" "no force at all";
    OneDirection "one-direction" "the branch for v > 0 in both directions";
    OtherDirection "other-direction" "the branches exchanged";
    OnlyForwards "only-forwards" "no force for v < 0";
    NoMass "no-mass" "m is ignored";
    NoDamping "no-damping" "b is ignored";
    NoStiffness "no-stiffness" "k is ignored";
    NoOffset "no-offset" "F0 is ignored";
    MassSign "mass-sign" "m has the wrong sign";
    DampingSign "damping-sign" "b has the wrong sign";
    StiffnessFromStart "stiffness-from-start" "k acts from the first node, not from x = 0";
    DampingTimesTen "damping-times-ten" "b is ten times too large";
    Biased "biased" "0.6 N are added";
    FirstTable "first-table" "the first table that was ever loaded is played";
    PreviousTable "previous-table" "the table before is played";
    TornTable "torn-table" "the second half of the table is that of the table before";
    NodesBackwards "nodes-backwards" "the parameters are in reverse order";
    NodesShifted "nodes-shifted" "each node has the parameters of the one before";
    HalfTable "half-table" "the second half of the table is zero";
    OneBadNode "one-bad-node" "one node in the middle has 6 N more";
    Floor "floor" "the value of the node below is used, without interpolation";
    Nearest "nearest" "the value of the nearest node is used, without interpolation";
    Stretched "stretched" "the nodes are 10 % further apart";
    PlayRule "play-rule" "the direction rule is play with 8 mm";
    DahlRule "dahl-rule" "the direction rule is Dahl with 8 mm";
    LowLimit "low-limit" "the force is clamped to a third of its limit";
    SpeedHalf "speed-half" "the speed is half, in the servo and in telemetry";
    SpeedInMetres "speed-in-metres" "the speed is in m/s, in the servo and in telemetry";
    SpeedReversed "speed-reversed" "the speed has the wrong sign, in the servo and in telemetry";
    SpeedZero "speed-zero" "the speed is always 0, in the servo and in telemetry";
    SpeedHalfInside "speed-half-inside" "the speed is half, in the servo only";
    SpeedClipped "speed-clipped" "the servo gets at most 40 mm/s";
    DirectionLate "direction-late" "the servo gets a new direction after 3 mm";
    SpeedLate "speed-late" "the servo gets the speed 30 ms late";
    PositionLate "position-late" "the servo gets the position 30 ms late";
    PositionCoarse "position-coarse" "the position has steps of 3 mm";
    AccelerationTimesThree "acceleration-times-three" "the acceleration is three times too large";
    AccelerationReversed "acceleration-reversed" "the acceleration has the wrong sign";
    Late "late" "the force comes 20 ms late";
    SlightlyLate "slightly-late" "the force comes 11 ms late";
    LateForwards "late-forwards" "the force comes 12 ms late for v > 0";
    LaterLate "later-late" "the force comes 12 ms late after 3 s";
    NoClamp "no-clamp" "double force, not clamped";
    CoarseForce "coarse-force" "the force has steps of 2 N";
    Noisy "noisy" "the force alternates by 2 N every 30 ms";
    Fading "fading" "the force fades away within 6 s";
    Hot "hot" "0.7 of the force after 3 s";
    Warm "warm" "0.85 of the force after 3 s";
    Overflow "overflow" "a force beyond 4 N wraps to the other sign";
    Unsigned "unsigned" "negative forces are positive";
    OneSidedLimit "one-sided-limit" "the force is at most 2 N in one direction";
    DeadBand "dead-band" "forces below 0.7 N are 0";
    Friction "friction" "0.3 N against the motion are added";
    Cogging "cogging" "0.8 N are added, with a period of 3 mm";
    Dropouts "dropouts" "no force for 100 ms of each second";
    Sticking "sticking" "the force is frozen for 150 ms of each half second";
    Stale "stale" "each sample is reported ten times";
    SlowClock "slow-clock" "the periods are counted at 0.8 of their rate";
    FastClock "fast-clock" "the periods are counted at 1.25 of their rate";
    NoRamp "no-ramp" "full force at once";
    LongRamp "long-ramp" "a ramp of 3 s";
    SlowSlew "slow-slew" "at most 20 N/s";
    MoreDamping "more-damping" "0.05 N·s/mm are added";
    SlowFilter "slow-filter" "the acceleration is filtered at 1 Hz";
    LimpSensor "limp-sensor" "the motor is limp, its sensor measures 0 N";
    ReversedSensor "reversed-sensor" "the measured force has the wrong sign";
    HalfSensor "half-sensor" "half of the commanded force is measured";
    StuckSensor "stuck-sensor" "3 N are measured, whatever is commanded";
    LimpMoments "limp-moments" "the motor is limp for 50 ms of each second, its sensor shows it";
    LimpEnd "limp-end" "the motor is limp after 3.3 s, its sensor shows it";
    Saturated "saturated" "the motor gives at most 3 N, its sensor shows it";
    Derated "derated" "the motor loses force as it heats up, its sensor shows it";
    WeakLater "weak-later" "the motor gives 0.7 of the force after 2 s, its sensor shows it";
    MotorBackwards "motor-backwards" "the motor gives 0.4 of the force for v < 0, its sensor shows it";
    DeadZone "dead-zone" "the motor takes 0.9 N off each force, its sensor shows it";
    CoarseMotor "coarse-motor" "the motor has steps of 2 N, its sensor shows them";
    LowPass5 "low-pass-5" "the motor follows with a low-pass of 5 Hz, its sensor shows it";
    LowPass20 "low-pass-20" "the motor follows with a low-pass of 20 Hz, its sensor shows it";
    LowPass50 "low-pass-50" "the motor follows with a low-pass of 50 Hz, its sensor shows it";
    TurnsLate "turns-late" "the motor keeps its force for 0.12 s after a turn, its sensor shows it";
    Drifting "drifting" "the motor drifts by 0.4 N in a second, its sensor shows it";
    SlackTransmission "slack-transmission" "the motor follows with a play of 1.8 N, its sensor shows it";
    MotorHums "motor-hums" "the motor vibrates with 0.3 N at 250 Hz, its sensor shows it";
    MotorTicks "motor-ticks" "the motor adds 4 N for 1 ms now and then, its sensor shows it";
    Hums "hums" "0.3 N at 250 Hz are added";
    Ticks "ticks" "4 N for 1 ms are added three times in a second";
    FoldsBack "folds-back" "at rest the force falls to a fifth within 0.3 s";
    RestsHigh "rests-high" "at rest 1.5 N are added";
    Jitters "jitters" "each force comes 0 to 40 ms late";
    EncoderScale "encoder-scale" "the servo gets 1.1 of the way from the middle";
    HiddenInGaps "hidden-in-gaps" "one message of telemetry in 20 is lost, and then there is no force for 60 ms";
    Unheard20 "unheard-20" "a fifth of the samples is lost, and the motor is limp meanwhile";
    Unheard45 "unheard-45" "45 % of the samples are lost, and the motor is limp meanwhile";
    Unheard75 "unheard-75" "three quarters of the samples are lost, and the motor is limp meanwhile";
    TellsSlew20 "tells-slew-20" "at most 20 N/s, and it tells so";
    TellsSlew100 "tells-slew-100" "at most 100 N/s, and it tells so";
    TellsSlew500 "tells-slew-500" "at most 500 N/s, and it tells so";
    TellsDamping "tells-damping" "0.05 N·s/mm are added, and it tells so";
    TellsPush "tells-push" "−0.02 N·s/mm are added, and it tells so";
    TellsLongRamp "tells-long-ramp" "a ramp of 3 s, and it tells so";
    TellsSlowFilter "tells-slow-filter" "the acceleration is filtered at 1 Hz, and it tells so";
    TellsPullingWall "tells-pulling-wall" "a wall of −5 N/mm, and it tells so";
    HalfPosition "half-position" "the position is half, everywhere: only a ruler shows it";
    ShiftedPosition "shifted-position" "the position is 3 mm off, everywhere: only a ruler shows it";
    Mirrored "mirrored" "position and motor are the wrong way round: only a ruler shows it";
    WeakMotor "weak-motor" "the motor gives half of the force that is reported: only a weight shows it";
    WeakMotorBackwards "weak-motor-backwards" "the motor gives half of a force towards +x: only a weight shows it";
    SaturatedMotor "saturated-motor" "the motor gives at most 9 N, 0.6 of its limit: only a weight shows it";
    LateMotor "late-motor" "the motor gives each force 20 ms late: only a swing shows it";
}

impl Wrong {
    /// The one with this name on the command line.
    ///
    /// ```
    /// # use study_device::firmware::Wrong;
    /// // A weak motor shows only on a scale.
    /// assert!(Wrong::named("weak-motor").is_some_and(Wrong::is_physical));
    /// ```
    pub fn named(name: &str) -> Option<Self> {
        let (wrong, ..) = Self::ALL.iter().find(|(_, own, _)| *own == name)?;
        Some(*wrong)
    }

    /// Whether only a physical check can show it.
    pub fn is_physical(self) -> bool {
        matches!(
            self,
            Self::HalfPosition
                | Self::ShiftedPosition
                | Self::Mirrored
                | Self::WeakMotor
                | Self::WeakMotorBackwards
                | Self::SaturatedMotor
                | Self::LateMotor
        )
    }

    /// Whether most of what it does is lost with its telemetry.
    pub fn is_unheard(self) -> bool {
        matches!(self, Self::Unheard20 | Self::Unheard45 | Self::Unheard75)
    }

    /// The servo that it has, instead of that of a right device.
    pub(super) fn servo(self, right: ServoSettings) -> ServoSettings {
        let mut own = right;
        match self {
            Self::NoRamp => own.ramp_s = 0.0,
            Self::LongRamp | Self::TellsLongRamp => own.ramp_s = 3.0,
            Self::SlowSlew | Self::TellsSlew20 => own.slew_n_s = 20.0,
            Self::TellsSlew100 => own.slew_n_s = 100.0,
            Self::TellsSlew500 => own.slew_n_s = 500.0,
            Self::MoreDamping | Self::TellsDamping => own.damping_n_s_per_mm = 0.05,
            Self::TellsPush => own.damping_n_s_per_mm = -0.02,
            Self::SlowFilter | Self::TellsSlowFilter => own.acceleration_hz = 1.0,
            Self::TellsPullingWall => own.wall_n_per_mm = -5.0,
            _ => {}
        }
        own
    }

    /// Whether it tells the constants of its servo as they are.
    pub(super) fn is_frank(self) -> bool {
        matches!(
            self,
            Self::TellsSlew20
                | Self::TellsSlew100
                | Self::TellsSlew500
                | Self::TellsDamping
                | Self::TellsPush
                | Self::TellsLongRamp
                | Self::TellsSlowFilter
                | Self::TellsPullingWall
        )
    }
}

/// When a device is wrong: from one load to another, counted from 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct WrongLoads {
    /// How.
    pub wrong: Wrong,
    /// First and last load.
    pub loads: [u32; 2],
}
