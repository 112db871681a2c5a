// A simulated axis with a hand that strokes it:
//   mcs -out:example.exe StudyDevice.cs Example.cs
//   study device check --command "mono example.exe"
// Replace the class by one for your device.

using System;
using System.Diagnostics;

class Simulated : Study.Axis
{
    readonly Stopwatch clock = Stopwatch.StartNew();

    public override Study.Reading Read()
    {
        double phase = 2.0 * Math.PI * 0.7 * clock.Elapsed.TotalSeconds;
        return new Study.Reading(12.5 * Math.Sin(phase));
    }

    public override void Push(double motorN) { }
}

static class Example
{
    static int Main()
    {
        var device = new Study.Device
        {
            Id = "simulated-csharp",
            Version = "0.1.0",
            Simulated = true,
            ForceN = 12.0,
            VelocityMmS = 1000.0,
            StrokeFromMm = -40.0,
            StrokeToMm = 40.0,
        };
        return Study.Program.Run(device, new Simulated());
    }
}
