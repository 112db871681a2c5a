function study_device (device, axis)
% STUDY_DEVICE  A haptic device as a controller program of `study` (study-process/2).
%
%   study_device (device, axis) plays until the input ends. docs/devices.md of `study`, section 3,
%   specifies messages and servo.
%
%   device  struct: id, force_n, velocity_mm_s, stroke_mm ([from to]); optional: version, simulated,
%           watchdog_ms (500), loop_hz (500), acceleration_hz (20), least_mass_kg (0),
%           stiffness_n_per_mm
%   axis    struct of functions: [x_mm, v_mm_s, measured_n] = axis.read () with NaN for what the
%           device does not measure; axis.push (motor_n) pushes the handle towards larger x, which
%           is the opposite of a table's force; axis.limp () switches the force off
%
%   Run by Octave on Linux and macOS (example.m). The branch for MATLAB reads the input by Java and
%   was never run.

  usual = struct ('version', '', 'simulated', false, 'watchdog_ms', 500, 'loop_hz', 500, ...
                  'acceleration_hz', 20, 'least_mass_kg', 0, 'stiffness_n_per_mm', []);
  for name = fieldnames (usual)'
    if ~isfield (device, name{1})
      device.(name{1}) = usual.(name{1});
    end
  end
  input = open_input ();
  axis.limp ();
  say_hello (device);
  clock = tic ();
  s = struct ('load', 0, 'table', [], 'servo', [], 'rows', '', 'sent', 0, 'alive', 0, ...
              't', 0, 'ended', false);
  due = toc (clock);
  try
    while ~s.ended
      [input, lines] = read_lines (input);
      for i = 1:numel (lines)
        s = command (s, lines{i}, device, axis, toc (clock));
      end
      if s.ended
        break;
      end
      if isempty (s.servo)
        pause (0.005);
        due = toc (clock);
      else
        s = turn (s, device, axis, clock);
        due = due + 1 / device.loop_hz;
        left = due - toc (clock);
        if left > 0
          pause (left);
        elseif left < -2 / device.loop_hz
          due = toc (clock);
        end
      end
    end
  catch problem
    axis.limp ();
    say ('"fault","what":"%s"', escaped (problem.message));
    rethrow (problem);
  end
  axis.limp ();
  close_input (input);
end

% ---- messages

function say (format, varargin)
  fprintf (1, ['{"say":' format '}\n'], varargin{:});
  if exist ('OCTAVE_VERSION', 'builtin')
    fflush (stdout);
  end
end

function text = escaped (text)
  text = strrep (strrep (text, '\', '\\'), '"', '\"');
  text(text < 32) = ' ';
end

function text = flag (value)
  words = {'false', 'true'};
  text = words{1 + logical (value)};
end

function say_hello (device)
  more = '';
  if ~isempty (device.version)
    more = [more sprintf(',"version":"%s"', escaped (device.version))];
  end
  if ~isempty (device.stiffness_n_per_mm)
    more = [more sprintf(',"stiffness_n_per_mm":%.9g', device.stiffness_n_per_mm)];
  end
  say (['"hello","format":"study-process/2","id":"%s","telemetry":true,"simulated":%s,' ...
        '"limits":{"force_n":%.9g,"velocity_mm_s":%.9g},"stroke_mm":[%.9g,%.9g],' ...
        '"watchdog_ms":%.9g,"servo":{"loop_hz":%.9g,"acceleration_hz":%.9g,' ...
        '"least_mass_kg":%.9g}%s'], escaped (device.id), flag (device.simulated), ...
       device.force_n, device.velocity_mm_s, device.stroke_mm, device.watchdog_ms, ...
       device.loop_hz, device.acceleration_hz, device.least_mass_kg, more);
end

function text = row (t, x, v, force, measured)
  if isnan (measured)
    text = sprintf ('[%.9g,%.9g,%.9g,%.9g,null],', t, x, v, force);
  else
    text = sprintf ('[%.9g,%.9g,%.9g,%.9g,%.9g],', t, x, v, force, measured);
  end
end

function s = send_rows (s)
  if ~isempty (s.rows)
    say ('"samples","load":%d,"samples":[%s]', s.load, s.rows(1:end-1));
    say ('"progress","load":%d,"strokes":%d,"clamps":%d', s.load, s.servo.strokes, s.servo.clamps);
    s.rows = '';
  end
end

function s = off (s, axis)
  axis.limp ();
  s.servo = [];
  s.table = [];
  s.rows = '';
end

function s = command (s, line, device, axis, now)
  if strcmp (line, 'END')
    s = free (s, axis);
    s.ended = true;
    return;
  end
  try
    % `do` is a word of the language
    c = jsondecode (strrep (line, '"do":', '"does":'));
  catch
    return;
  end
  switch c.does
    case 'load'
      s = off (s, axis);
      s.load = c.load;
      [s.table, why] = read_table (c, device);
      if isempty (why)
        say ('"loaded","load":%d', s.load);
      else
        say ('"refused","load":%d,"why":"%s"', s.load, escaped (why));
      end
    case 'free'
      s.load = c.load;
      s = free (s, axis);
    case 'start'
      if c.load == s.load && ~isempty (s.table) && isempty (s.servo)
        s.servo = new_servo ();
        s.alive = now;
        s.sent = now;
        say ('"started","load":%d', s.load);
      end
    case 'stop'
      if c.load == s.load && ~isempty (s.servo)
        axis.limp ();
        s = send_rows (s);
        done = s.servo;
        s = off (s, axis);
        say (['"outcome","load":%d,"duration_s":%.9g,"strokes":%d,"least_energy_j":%.9g,' ...
              '"switches_per_s":%.9g,"clamps":%d'], s.load, done.t, done.strokes, ...
             done.least_energy, done.switches / max (done.t, 1e-9), done.clamps);
      end
    case 'alive'
      if c.load == s.load
        s.alive = now;
      end
  end
end

function s = free (s, axis)
  if ~isempty (s.servo)
    s.t = s.servo.t;
  end
  s = off (s, axis);
  [x, v, measured] = axis.read ();
  if isnan (v)
    v = 0;
  end
  text = row (s.t, x, v, 0, measured);
  say ('"free","load":%d,"sample":%s', s.load, text(1:end-1));
end

function s = turn (s, device, axis, clock)
  now = toc (clock);
  if now - s.alive > 1e-3 * device.watchdog_ms
    s = trip (s, axis, 'no alive: the computer or its screen does not respond');
    return;
  end
  [x, v, measured] = axis.read ();
  now = toc (clock);
  [s.servo, why] = step (s.servo, s.table, device, now, x, v);
  if ~isempty (why)
    s = trip (s, axis, why);
    return;
  end
  axis.push (-s.servo.force);
  s.rows = [s.rows row(s.servo.t, x, s.servo.v, s.servo.force, measured)];
  if now - s.sent >= 0.02
    s.sent = now;
    s = send_rows (s);
  end
end

function s = trip (s, axis, why)
  axis.limp ();
  s = send_rows (s);
  s = off (s, axis);
  say ('"fault","what":"%s"', escaped (why));
end

% ---- the table and the servo

function [table, why] = read_table (c, device)
  table = [];
  why = '';
  if ~isfield (c, 'table') || isempty (c.table)
    why = 'it plays tables only';
    return;
  end
  given = c.table;
  t.x = given.x_mm(:)';
  t.positive = branch (given.positive);
  t.negative = branch (given.negative);
  t.lookup = given.lookup;
  t.rule = given.direction.rule;
  t.delta = given.direction.delta_mm;
  t.low = given.trained.x_mm(1);
  t.high = given.trained.x_mm(2);
  t.fastest = given.trained.v_mm_s;
  t.force_n = min (c.limits.force_n, device.force_n);
  t.velocity_mm_s = min (c.limits.velocity_mm_s, device.velocity_mm_s);
  if t.low < device.stroke_mm(1) || t.high > device.stroke_mm(2)
    why = sprintf ('it ranges from %g to %g mm, and the stroke from %g to %g mm', ...
                   t.low, t.high, device.stroke_mm);
  elseif ~any (strcmp (t.lookup, {'linear', 'floor', 'nearest'}))
    why = ['unknown look-up ' t.lookup];
  elseif ~any (strcmp (t.rule, {'sign', 'play', 'dahl'}))
    why = ['unknown direction rule ' t.rule];
  elseif numel (t.x) < 2 || any (diff (t.x) <= 0) || size (t.positive, 2) ~= numel (t.x) ...
         || size (t.negative, 2) ~= numel (t.x) || ~all (isfinite ([t.positive(:); t.negative(:)]))
    why = 'its nodes are not valid';
  else
    table = t;
  end
end

function b = branch (given)
  b = [given.m_kg(:)'; given.b_n_s_per_mm(:)'; given.k_n_per_mm(:)'; given.f0_n(:)'];
end

function servo = new_servo ()
  servo = struct ('began', NaN, 'last', 0, 'x', 0, 'v', 0, 't', 0, 'band', 0, 'low', 0, 'z', 1, ...
                  'slewed', 0, 'force', 0, 'end', 0, 'strokes', 0, 'clamps', 0, 'clamping', false, ...
                  'energy', 0, 'least_energy', 0, 'switches', 0);
end

function [o, why] = step (o, t, device, now, x, v)
  why = '';
  if isnan (o.began)
    o.began = now;
    dt = 1 / device.loop_hz;
    dx = 0;
    if isnan (v)
      v = 0;
    end
    a = 0;
  else
    dt = now - o.last;
    if ~(dt > 0)
      return;
    end
    dx = x - o.x;
    if isnan (v)
      v = o.v + (1 - exp (-2 * pi * 200 * dt)) * (dx / dt - o.v);
    end
    a = 1e-3 * (v - o.v) / dt;
  end
  if ~isfinite (x) || ~isfinite (v)
    why = 'position or speed is no number';
  elseif abs (v) > t.velocity_mm_s
    why = sprintf ('velocity limit: %.0f mm/s', abs (v));
  elseif x < t.low - 2.5 || x > t.high + 2.5
    why = sprintf ('beyond the range: %.1f mm', x);
  elseif abs (dx) > max (1, dt * device.loop_hz)
    why = sprintf ('the position jumped by %.1f mm', dx);
  end
  if ~isempty (why)
    return;
  end
  o.energy = o.energy + 1e-3 * o.force * dx;
  o.least_energy = min (o.least_energy, o.energy);
  o.last = now;
  o.x = x;
  o.v = v;
  o.t = now - o.began;
  zone = 0.2 * (t.high - t.low);
  place = (x >= t.high - zone) - (x <= t.low + zone);
  if place ~= 0
    o.strokes = o.strokes + (o.end == -place);
    o.end = place;
  end
  % low-pass of the acceleration: Butterworth, two poles, two trapezoidal integrators
  k = tan (min (pi * device.acceleration_hz * dt, 1.5));
  first = 1 / (1 + k * (k + sqrt (2)));
  off = a - o.low;
  band = first * o.band + k * first * off;
  out = o.low + k * first * o.band + k * k * first * off;
  o.band = 2 * band - o.band;
  o.low = 2 * out - o.low;
  % direction state
  z = o.z;
  switch t.rule
    case 'sign'
      if v ~= 0
        z = sign (v);
      end
    case 'play'
      z = min (max (z + 2 * dx / t.delta, -1), 1);
    case 'dahl'
      if dx ~= 0
        z = sign (dx) + (z - sign (dx)) * exp (-abs (dx) / t.delta);
      end
  end
  o.switches = o.switches + ((z >= 0) ~= (o.z >= 0));
  o.z = z;
  % the table
  inside = min (max (x, t.low), t.high);
  left = max (sum (t.x <= inside), 1);
  part = 0;
  if left < numel (t.x) && inside >= t.x(1)
    part = (inside - t.x(left)) / (t.x(left+1) - t.x(left));
    if strcmp (t.lookup, 'floor')
      part = 0;
    elseif strcmp (t.lookup, 'nearest')
      left = left + (part > 0.5);
      part = 0;
    end
  end
  p = (1 + z) / 2 * t.positive(:, left) + (1 - z) / 2 * t.negative(:, left);
  if part > 0
    next = (1 + z) / 2 * t.positive(:, left+1) + (1 - z) / 2 * t.negative(:, left+1);
    p = p + part * (next - p);
  end
  slow = min (max (v, -t.fastest), t.fastest);
  wanted = max (p(1), device.least_mass_kg) * out + p(2) * slow + p(3) * inside + p(4) + 0.002 * v;
  beyond = x - inside;
  if beyond ~= 0
    wall = 10 * beyond + 0.01 * v;
    if wall * beyond > 0
      wanted = wanted + wall;
    end
  end
  ramp = 1;
  if o.t < 0.4
    ramp = 0.5 - 0.5 * cos (pi * o.t / 0.4);
  end
  size_n = abs (wanted * ramp);
  if size_n > t.force_n
    o.clamps = o.clamps + ~o.clamping;
    o.clamping = true;
  elseif size_n < 0.9 * t.force_n
    o.clamping = false;
  end
  change = min (max (wanted, -t.force_n), t.force_n) - o.slewed;
  most = 2000 * dt;
  o.slewed = o.slewed + min (max (change, -most), most);
  o.force = min (max (o.slewed * ramp, -t.force_n), t.force_n);
end

% ---- input that does not wait

function input = open_input ()
  input = struct ('rest', '', 'fid', -1);
  if exist ('OCTAVE_VERSION', 'builtin')
    % Its end is a line: a read that does not wait cannot tell it from nothing.
    input.fid = popen ('cat; echo; echo END', 'r');
    fcntl (input.fid, F_SETFL, O_NONBLOCK);
  end
end

function [input, lines] = read_lines (input)
  if input.fid >= 0
    more = fread (input.fid, 65536, 'char=>char')';
    if isempty (more)
      fclear (input.fid);
    end
  else
    stream = java.lang.System.in;
    more = '';
    while stream.available () > 0
      byte = stream.read ();
      more(end+1) = char (byte);
    end
  end
  lines = {};
  if isempty (more)
    return;
  end
  parts = strsplit ([input.rest more], char (10), 'CollapseDelimiters', false);
  input.rest = parts{end};
  lines = parts(1:end-1);
end

function close_input (input)
  if input.fid >= 0
    pclose (input.fid);
  end
end
