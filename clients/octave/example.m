% A simulated axis with a hand that strokes it:
%   study device check --command "octave-cli --quiet clients/octave/example.m"
% Replace the two functions by those of your device.
1;
addpath (fileparts (mfilename ('fullpath')));

function [x_mm, v_mm_s, measured_n] = read_axis ()
  x_mm = 12.5 * sin (2 * pi * 0.7 * time ());
  v_mm_s = NaN;      % this device measures positions only
  measured_n = NaN;  % and has no force sensor
end

function push_axis (motor_n)
end

device = struct ('id', 'simulated-octave', 'force_n', 12, 'velocity_mm_s', 1000, ...
                 'stroke_mm', [-40 40], 'version', '0.1.0', 'simulated', true);
axis = struct ('read', @read_axis, 'push', @push_axis, 'limp', @() push_axis (0));
study_device (device, axis);
