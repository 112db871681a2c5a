// A haptic device as a controller program of `study` (study-process/2), for .NET, Mono and Unity.
//
// Derive from Study.Axis, and call Study.Program.Run: it plays until the input ends. docs/devices.md of `study`,
// section 3, specifies messages and servo. One file, without packages.
//
// In Unity build a player, let it call Run on a thread of its own, and give its executable to
// `study run --command`. Nothing else may write to the standard output.

using System;
using System.Collections.Concurrent;
using System.Collections.Generic;
using System.Diagnostics;
using System.Globalization;
using System.IO;
using System.Text;
using System.Threading;

namespace Study
{
    /// What the device measured at one instant.
    public struct Reading
    {
        /// Position of the handle, mm.
        public double X;
        /// Its speed, mm/s; NaN if the device measures positions only.
        public double V;
        /// Force that the hand applies towards larger x by a sensor, N; NaN without one.
        public double Measured;

        public Reading(double x, double v = double.NaN, double measured = double.NaN)
        {
            X = x;
            V = v;
            Measured = measured;
        }
    }

    /// One axis of a device. All methods are called by one thread, and none may wait for long.
    public abstract class Axis
    {
        public abstract Reading Read();

        /// Pushes the handle with this force, N, positive towards larger x: the opposite of a table's force.
        public abstract void Push(double motorN);

        /// Switches the force off at once, in any state, also twice.
        public virtual void Limp() { Push(0.0); }
    }

    /// What the program says of itself.
    public sealed class Device
    {
        public string Id = "device";
        public string Version;
        public bool Simulated;
        public double ForceN = 5.0, VelocityMmS = 500.0;
        public double StrokeFromMm, StrokeToMm;
        public double StiffnessNPerMm = double.NaN;
        /// The force is off this long after the last sign of life of `study`, ms: 50 to 500.
        public double WatchdogMs = 200.0;
        public double LoopHz = 1000.0;
        /// Constants of the servo; state others than these only if the mechanics require it.
        public double AccelerationHz = 20.0, LeastMassKg = 0.0, DampingNsPerMm = 0.002;
        public double WallNPerMm = 10.0, WallNsPerMm = 0.01, OvertravelMm = 2.5, JumpMm = 1.0;
        public double SlewNS = 2000.0, RampS = 0.4;
    }

    /// The servo has switched the force off.
    public sealed class Trip : Exception
    {
        public Trip(string why) : base(why) { }
    }

    /// A realization as `load` has it.
    public sealed class Table
    {
        public readonly double[] X;
        public readonly double[][] Positive, Negative;
        public readonly string Lookup, Rule;
        public readonly double Delta, Low, High, Fastest;

        public Table(Dictionary<string, object> value)
        {
            X = Json.Numbers(value["x_mm"]);
            Positive = Branch(value["positive"]);
            Negative = Branch(value["negative"]);
            Lookup = (string)value["lookup"];
            var direction = (Dictionary<string, object>)value["direction"];
            Rule = (string)direction["rule"];
            Delta = direction["delta_mm"] is double ? (double)direction["delta_mm"] : 0.0;
            var trained = (Dictionary<string, object>)value["trained"];
            var range = Json.Numbers(trained["x_mm"]);
            Low = range[0];
            High = range[1];
            Fastest = (double)trained["v_mm_s"];
            if (Lookup != "linear" && Lookup != "floor" && Lookup != "nearest") throw new FormatException("unknown look-up " + Lookup);
            if (Rule != "sign" && Rule != "play" && Rule != "dahl") throw new FormatException("unknown direction rule " + Rule);
            if (Rule != "sign" && !(Delta > 0.0)) throw new FormatException("the direction rule has no delta_mm above 0");
            bool ascends = X.Length > 1 && Low < High;
            for (int i = 1; i < X.Length; i++) ascends &= X[i] > X[i - 1];
            if (!ascends) throw new FormatException("its positions do not ascend");
        }

        double[][] Branch(object value)
        {
            var branch = (Dictionary<string, object>)value;
            var columns = new List<double[]>();
            foreach (var key in new[] { "m_kg", "b_n_s_per_mm", "k_n_per_mm", "f0_n" })
            {
                var column = Json.Numbers(branch[key]);
                if (column.Length != X.Length) throw new FormatException("the branches have other nodes than x_mm");
                columns.Add(column);
            }
            return columns.ToArray();
        }

        /// Mass, damping, stiffness and offset at a position, both directions mixed by z.
        public void Parameters(double x, double z, double[] found)
        {
            int left = Array.BinarySearch(X, x);
            if (left < 0) left = ~left - 1;
            double part = 0.0;
            if (left < 0) left = 0;
            else if (left < X.Length - 1)
            {
                part = (x - X[left]) / (X[left + 1] - X[left]);
                if (Lookup == "floor") part = 0.0;
                else if (Lookup == "nearest")
                {
                    if (part > 0.5) left++;
                    part = 0.0;
                }
            }
            double up = 0.5 * (1.0 + z), down = 0.5 * (1.0 - z);
            for (int i = 0; i < 4; i++)
            {
                double here = up * Positive[i][left] + down * Negative[i][left];
                if (part > 0.0) here += part * (up * Positive[i][left + 1] + down * Negative[i][left + 1] - here);
                found[i] = here;
            }
        }
    }

    /// Plays a table; one for each playback.
    public sealed class Servo
    {
        const double SpeedHz = 200.0;
        readonly Table table;
        readonly Device own;
        readonly double limit, fastest;
        readonly double[] at = new double[4];
        double began = double.NaN, last, x, v, band, low, z = 1.0, slewed, energy;
        bool clamping;
        int end, switches;
        public double Force, Speed, Time, LeastEnergy;
        public int Strokes, Clamps;

        public Servo(Table table, Device own, double forceN, double velocityMmS)
        {
            this.table = table;
            this.own = own;
            limit = forceN;
            fastest = velocityMmS;
        }

        public double SwitchesPerS { get { return Time > 0.0 ? switches / Time : 0.0; } }

        /// One turn at a time, s, of a clock that only rises: the force that the hand has to apply from now on, N.
        public double Step(double t, double x, double v)
        {
            double dt = 1.0 / own.LoopHz, dx = 0.0, a = 0.0;
            if (double.IsNaN(began))
            {
                began = t;
                if (double.IsNaN(v)) v = 0.0;
            }
            else
            {
                dt = t - last;
                if (!(dt > 0.0)) return Force;
                dx = x - this.x;
                if (double.IsNaN(v)) v = this.v + (1.0 - Math.Exp(-2.0 * Math.PI * SpeedHz * dt)) * (dx / dt - this.v);
                a = 1e-3 * (v - this.v) / dt;
            }
            CheckTrips(x, v, dx, dt);
            energy += 1e-3 * Force * dx;
            LeastEnergy = Math.Min(LeastEnergy, energy);
            last = t;
            this.x = x;
            this.v = v;
            Time = t - began;
            Speed = v;
            CountStrokes();

            a = LowPass(a, dt);
            Turn(dx);
            double inside = Math.Min(Math.Max(x, table.Low), table.High);
            table.Parameters(inside, z, at);
            double slow = Math.Min(Math.Max(v, -table.Fastest), table.Fastest);
            double wanted = Math.Max(at[0], own.LeastMassKg) * a + at[1] * slow + at[2] * inside + at[3] + own.DampingNsPerMm * v;
            double beyond = x - inside;
            if (beyond != 0.0)
            {
                double wall = own.WallNPerMm * beyond + own.WallNsPerMm * v;
                if (wall * beyond > 0.0) wanted += wall;
            }
            if (double.IsNaN(wanted) || double.IsInfinity(wanted)) throw new Trip("the force is no number");
            double ramp = Time < own.RampS ? 0.5 - 0.5 * Math.Cos(Math.PI * Time / own.RampS) : 1.0;
            CountClamps(Math.Abs(wanted * ramp));
            double most = own.SlewNS * dt;
            double change = Math.Min(Math.Max(wanted, -limit), limit) - slewed;
            slewed += Math.Min(Math.Max(change, -most), most);
            Force = Math.Min(Math.Max(slewed * ramp, -limit), limit);
            return Force;
        }

        void CheckTrips(double x, double v, double dx, double dt)
        {
            if (double.IsNaN(x + v) || double.IsInfinity(x + v)) throw new Trip("position or speed is no number");
            if (Math.Abs(v) > fastest) throw new Trip("velocity limit: " + Json.Text(Math.Round(Math.Abs(v))) + " mm/s");
            if (x < table.Low - own.OvertravelMm || x > table.High + own.OvertravelMm) throw new Trip("beyond the range: " + Json.Text(Math.Round(x, 1)) + " mm");
            if (Math.Abs(dx) > own.JumpMm * Math.Max(1.0, dt * own.LoopHz)) throw new Trip("the position jumped by " + Json.Text(Math.Round(dx, 1)) + " mm");
        }

        double LowPass(double a, double dt)
        {
            // Butterworth, two poles, as two trapezoidal integrators: the turn may have any length.
            double k = Math.Tan(Math.Min(Math.PI * own.AccelerationHz * dt, 1.5));
            double first = 1.0 / (1.0 + k * (k + Math.Sqrt(2.0)));
            double error = a - low;
            double bandNow = first * band + k * first * error;
            double result = low + k * first * band + k * k * first * error;
            band = 2.0 * bandNow - band;
            low = 2.0 * result - low;
            return result;
        }

        void Turn(double dx)
        {
            double before = z;
            if (table.Rule == "sign") { if (v != 0.0) z = v > 0.0 ? 1.0 : -1.0; }
            else if (table.Rule == "play") z = Math.Min(Math.Max(z + 2.0 * dx / table.Delta, -1.0), 1.0);
            else if (dx != 0.0)
            {
                double sign = dx > 0.0 ? 1.0 : -1.0;
                z = sign + (z - sign) * Math.Exp(-Math.Abs(dx) / table.Delta);
            }
            if ((z >= 0.0) != (before >= 0.0)) switches++;
        }

        void CountStrokes()
        {
            double zone = 0.2 * (table.High - table.Low);
            int place = x <= table.Low + zone ? -1 : x >= table.High - zone ? 1 : 0;
            if (place == 0) return;
            if (end == -place) Strokes++;
            end = place;
        }

        void CountClamps(double size)
        {
            if (size > limit)
            {
                if (!clamping) Clamps++;
                clamping = true;
            }
            else if (size < 0.9 * limit) clamping = false;
        }
    }

    /// The loop and its messages.
    public sealed class Program
    {
        const double SendS = 0.02;
        readonly Device device;
        readonly Axis axis;
        readonly ConcurrentQueue<string> commands = new ConcurrentQueue<string>();
        readonly BlockingCollection<string> lines = new BlockingCollection<string>();
        readonly Stopwatch clock = Stopwatch.StartNew();
        readonly StringBuilder rows = new StringBuilder();
        long load;
        Table table;
        double forceN, velocityMmS, sent, alive, lastTime;
        Servo servo;
        bool ended;

        Program(Device device, Axis axis)
        {
            this.device = device;
            this.axis = axis;
        }

        /// Plays until the input ends; returns the exit status. The force is off when it returns.
        public static int Run(Device device, Axis axis)
        {
            var program = new Program(device, axis);
            var writer = new Thread(program.Write) { IsBackground = true };
            writer.Start();
            int status = 0;
            try { program.Loop(); }
            catch (Exception error)
            {
                axis.Limp();
                program.Say("\"fault\",\"what\":" + Json.Quoted(error.Message));
                Console.Error.WriteLine(error.Message);
                status = 1;
            }
            axis.Limp();
            program.lines.CompleteAdding();
            writer.Join(300);
            return status;
        }

        // A host that does not read must not stop the loop.
        void Write()
        {
            try
            {
                var output = Console.OpenStandardOutput();
                foreach (var line in lines.GetConsumingEnumerable())
                {
                    var bytes = Encoding.UTF8.GetBytes(line);
                    output.Write(bytes, 0, bytes.Length);
                    output.Flush();
                }
            }
            catch (IOException) { }
        }

        void Read()
        {
            using (var input = new StreamReader(Console.OpenStandardInput(), new UTF8Encoding(false), false, 65536))
            {
                try
                {
                    string line;
                    while ((line = input.ReadLine()) != null) commands.Enqueue(line);
                }
                catch (IOException) { }
                commands.Enqueue(null);
            }
        }

        void Say(string message) { lines.Add("{\"say\":" + message + "}\n"); }

        double Now { get { return clock.Elapsed.TotalSeconds; } }

        void Hello()
        {
            var d = device;
            string more = "";
            if (d.Version != null) more += ",\"version\":" + Json.Quoted(d.Version);
            if (!double.IsNaN(d.StiffnessNPerMm)) more += ",\"stiffness_n_per_mm\":" + Json.Text(d.StiffnessNPerMm);
            Say("\"hello\",\"format\":\"study-process/2\",\"id\":" + Json.Quoted(d.Id) + ",\"telemetry\":true,\"simulated\":" + (d.Simulated ? "true" : "false")
                + ",\"limits\":{\"force_n\":" + Json.Text(d.ForceN) + ",\"velocity_mm_s\":" + Json.Text(d.VelocityMmS)
                + "},\"stroke_mm\":[" + Json.Text(d.StrokeFromMm) + "," + Json.Text(d.StrokeToMm) + "],\"watchdog_ms\":" + Json.Text(d.WatchdogMs)
                + ",\"servo\":{\"loop_hz\":" + Json.Text(d.LoopHz) + ",\"acceleration_hz\":" + Json.Text(d.AccelerationHz)
                + ",\"least_mass_kg\":" + Json.Text(d.LeastMassKg) + ",\"damping_n_s_per_mm\":" + Json.Text(d.DampingNsPerMm)
                + ",\"wall_n_per_mm\":" + Json.Text(d.WallNPerMm) + ",\"wall_n_s_per_mm\":" + Json.Text(d.WallNsPerMm)
                + ",\"overtravel_mm\":" + Json.Text(d.OvertravelMm) + ",\"jump_mm\":" + Json.Text(d.JumpMm)
                + ",\"slew_n_s\":" + Json.Text(d.SlewNS) + ",\"ramp_s\":" + Json.Text(d.RampS) + "}" + more);
        }

        void Loop()
        {
            axis.Limp();
            Hello();
            new Thread(Read) { IsBackground = true }.Start();
            double due = Now;
            while (!ended)
            {
                string line;
                while (!ended && commands.TryDequeue(out line)) Command(line);
                if (ended) return;
                if (servo == null)
                {
                    Thread.Sleep(2);
                    due = Now;
                    continue;
                }
                Turn();
                due += 1.0 / device.LoopHz;
                double left = due - Now;
                if (left < -2.0 / device.LoopHz) due = Now;
                // Sleep waits for a millisecond or more: the last part is waited for by looking.
                while ((left = due - Now) > 0.0)
                {
                    if (left > 1.5e-3) Thread.Sleep(1);
                    else Thread.Yield();
                }
            }
        }

        void Turn()
        {
            if (Now - alive > 1e-3 * device.WatchdogMs)
            {
                Fault("no alive: the computer or its screen does not respond");
                return;
            }
            var reading = axis.Read();
            double now = Now;
            try { axis.Push(-servo.Step(now, reading.X, reading.V)); }
            catch (Trip trip)
            {
                Fault(trip.Message);
                return;
            }
            if (rows.Length > 0) rows.Append(',');
            Row(rows, servo.Time, reading.X, servo.Speed, servo.Force, reading.Measured);
            if (now - sent >= SendS)
            {
                sent = now;
                Send();
            }
        }

        static void Row(StringBuilder into, double t, double x, double v, double force, double measured)
        {
            into.Append('[').Append(Json.Text(t)).Append(',').Append(Json.Text(x)).Append(',').Append(Json.Text(v)).Append(',')
                .Append(Json.Text(force)).Append(',').Append(double.IsNaN(measured) ? "null" : Json.Text(measured)).Append(']');
        }

        void Send()
        {
            if (rows.Length == 0) return;
            Say("\"samples\",\"load\":" + load + ",\"samples\":[" + rows + "]");
            Say("\"progress\",\"load\":" + load + ",\"strokes\":" + servo.Strokes + ",\"clamps\":" + servo.Clamps);
            rows.Length = 0;
        }

        // No force before the next load and start.
        void Off()
        {
            axis.Limp();
            if (servo != null) lastTime = servo.Time;
            servo = null;
            table = null;
            rows.Length = 0;
        }

        void Fault(string why)
        {
            axis.Limp();
            Send();
            Off();
            Say("\"fault\",\"what\":" + Json.Quoted(why));
        }

        void Free()
        {
            Off();
            var reading = axis.Read();
            var sample = new StringBuilder();
            Row(sample, lastTime, reading.X, double.IsNaN(reading.V) ? 0.0 : reading.V, 0.0, reading.Measured);
            Say("\"free\",\"load\":" + load + ",\"sample\":" + sample);
        }

        void Command(string line)
        {
            if (line == null)
            {
                Free();
                ended = true;
                return;
            }
            Dictionary<string, object> command;
            try { command = Json.Read(line) as Dictionary<string, object>; }
            catch (FormatException) { return; }
            object found, number;
            if (command == null || !command.TryGetValue("do", out found) || !command.TryGetValue("load", out number)) return;
            string what = found as string;
            long about = (long)(double)number;
            if (what == "load")
            {
                Off();
                load = about;
                Load(command);
            }
            else if (what == "free")
            {
                load = about;
                Free();
            }
            else if (about != load) return;
            else if (what == "start" && table != null && servo == null)
            {
                servo = new Servo(table, device, forceN, velocityMmS);
                sent = alive = Now;
                Say("\"started\",\"load\":" + load);
            }
            else if (what == "stop" && servo != null)
            {
                axis.Limp();
                Send();
                var done = servo;
                Off();
                Say("\"outcome\",\"load\":" + load + ",\"duration_s\":" + Json.Text(done.Time) + ",\"strokes\":" + done.Strokes + ",\"least_energy_j\":"
                    + Json.Text(done.LeastEnergy) + ",\"switches_per_s\":" + Json.Text(done.SwitchesPerS) + ",\"clamps\":" + done.Clamps);
            }
            else if (what == "alive") alive = Now;
        }

        void Load(Dictionary<string, object> command)
        {
            try
            {
                object given;
                if (!command.TryGetValue("table", out given) || given == null) throw new FormatException("it plays tables only");
                var read = new Table((Dictionary<string, object>)given);
                if (read.Low < device.StrokeFromMm || read.High > device.StrokeToMm) throw new FormatException("it ranges beyond the stroke");
                var limits = (Dictionary<string, object>)command["limits"];
                forceN = Math.Min((double)limits["force_n"], device.ForceN);
                velocityMmS = Math.Min((double)limits["velocity_mm_s"], device.VelocityMmS);
                table = read;
            }
            catch (Exception error)
            {
                if (!(error is FormatException || error is KeyNotFoundException || error is InvalidCastException)) throw;
                Say("\"refused\",\"load\":" + load + ",\"why\":" + Json.Quoted(error.Message));
                return;
            }
            Say("\"loaded\",\"load\":" + load);
        }
    }

    /// As much of JSON as the messages need: objects, arrays (List), strings, double, bool, null.
    public static class Json
    {
        public static string Text(double value) { return value.ToString("R", CultureInfo.InvariantCulture); }

        public static string Quoted(string text)
        {
            var result = new StringBuilder("\"");
            foreach (char c in text)
            {
                if (c == '"' || c == '\\') result.Append('\\').Append(c);
                else if (c < ' ') result.Append(' ');
                else result.Append(c);
            }
            return result.Append('"').ToString();
        }

        public static double[] Numbers(object value)
        {
            var list = (List<object>)value;
            var numbers = new double[list.Count];
            for (int i = 0; i < numbers.Length; i++) numbers[i] = (double)list[i];
            return numbers;
        }

        public static object Read(string text)
        {
            int at = 0;
            object value = Value(text, ref at, 0);
            Skip(text, ref at);
            if (at != text.Length) throw new FormatException("more than one value");
            return value;
        }

        static void Skip(string text, ref int at)
        {
            while (at < text.Length && char.IsWhiteSpace(text[at])) at++;
        }

        static object Value(string text, ref int at, int depth)
        {
            Skip(text, ref at);
            if (at >= text.Length || depth > 32) throw new FormatException("no value");
            switch (text[at])
            {
                case '{': return Members(text, ref at, depth);
                case '[': return Items(text, ref at, depth);
                case '"': return String(text, ref at);
                case 't': return Word(text, ref at, "true", true);
                case 'f': return Word(text, ref at, "false", false);
                case 'n': return Word(text, ref at, "null", null);
            }
            int from = at;
            while (at < text.Length && "+-.eE0123456789".IndexOf(text[at]) >= 0) at++;
            return double.Parse(text.Substring(from, at - from), NumberStyles.Float, CultureInfo.InvariantCulture);
        }

        static object Word(string text, ref int at, string word, object value)
        {
            if (string.CompareOrdinal(text, at, word, 0, word.Length) != 0) throw new FormatException("an unknown word");
            at += word.Length;
            return value;
        }

        static bool Ends(string text, ref int at, char end)
        {
            Skip(text, ref at);
            if (at >= text.Length) throw new FormatException("it is not complete");
            if (text[at] == ',') { at++; return false; }
            if (text[at] != end) throw new FormatException("a comma is missing");
            at++;
            return true;
        }

        static Dictionary<string, object> Members(string text, ref int at, int depth)
        {
            var members = new Dictionary<string, object>();
            at++;
            Skip(text, ref at);
            if (at < text.Length && text[at] == '}') { at++; return members; }
            do
            {
                Skip(text, ref at);
                string key = String(text, ref at);
                Skip(text, ref at);
                if (at >= text.Length || text[at] != ':') throw new FormatException("a colon is missing");
                at++;
                members[key] = Value(text, ref at, depth + 1);
            } while (!Ends(text, ref at, '}'));
            return members;
        }

        static List<object> Items(string text, ref int at, int depth)
        {
            var items = new List<object>();
            at++;
            Skip(text, ref at);
            if (at < text.Length && text[at] == ']') { at++; return items; }
            do { items.Add(Value(text, ref at, depth + 1)); } while (!Ends(text, ref at, ']'));
            return items;
        }

        static string String(string text, ref int at)
        {
            if (at >= text.Length || text[at] != '"') throw new FormatException("a text is missing");
            var result = new StringBuilder();
            for (at++; at < text.Length && text[at] != '"'; at++)
            {
                if (text[at] != '\\') { result.Append(text[at]); continue; }
                at++;
                if (at >= text.Length) break;
                char c = text[at];
                if (c == 'u' && at + 4 < text.Length)
                {
                    result.Append((char)int.Parse(text.Substring(at + 1, 4), NumberStyles.HexNumber, CultureInfo.InvariantCulture));
                    at += 4;
                }
                else result.Append(c == 'n' ? '\n' : c == 't' ? '\t' : c == 'r' ? '\r' : c == 'b' ? '\b' : c == 'f' ? '\f' : c);
            }
            if (at >= text.Length) throw new FormatException("a text does not end");
            at++;
            return result.ToString();
        }
    }
}
