% Geometric tracking law over UDP, for GNU Octave (apt install octave octave-sockets):
%
%     octave-cli examples/laws/geometric_udp.m 9101 9102        (in one terminal)
%     quadlab fly figure_eight --set control.law=udp control.plugin.udp_peer=127.0.0.1:9101
%
% Arguments: our port, and control.plugin.udp_port of the vehicle. It is the law of geometric_pid.py
% beside this file. docs/extending/plugins.md lists the 39 doubles that come and the 5 of an answer.
pkg load sockets

function R = rotation (q)
  w = q(1); v = q(2:4);
  R = (w * w - v' * v) * eye (3) + 2 * (v * v' + w * cross (repmat (v, 1, 3), eye (3)));
end

% Attitude whose z axis is along a force (m/s^2), and its angular velocity (rad/s, its own axes).
function [D, omega] = attitude (force, rate, yaw, yaw_rate)
  z = force / norm (force);
  y = cross (z, [cos(yaw); sin(yaw); 0]);
  y = y / norm (y);
  x = cross (y, z);
  tip = (rate - (z' * rate) * z) / norm (force);
  D = [x, y, z];
  omega = [-(y' * tip); x' * tip; yaw_rate * z(3)];
end

ours = socket (AF_INET, SOCK_DGRAM, 0);
bind (ours, str2double (argv (){1}));
connect (ours, struct ("addr", "127.0.0.1", "port", str2double (argv (){2})));
disp ("ready"); fflush (stdout);
KP = [4; 4; 8]; KV = [3.5; 3.5; 5]; KI = [1; 1; 2];
KR = [60; 60; 12]; KW = [12; 12; 5]; KF = [10; 10; 2];
while true
  u = typecast (uint8 (recv (ours, 39 * 8)), "double")(:);
  dt = u(2); p = u(5:7); v = u(8:10); omega = u(15:17);
  r = u(18:20); r1 = u(21:23); r2 = u(24:26); r3 = u(27:29);
  yaw = u(33); yaw_rate = u(34); mass = u(36); J = u(37:39);
  if (u(3))
    integral_w = integral_b = zeros (3, 1); before = [];
  end
  R = rotation (u(11:14));
  nominal = r2 + [0; 0; 9.81];
  wanted = nominal + KP .* (r - p) + KV .* (r1 - v) + KI .* integral_w;
  D = attitude (wanted, zeros (3, 1), yaw, 0);
  [N, omega_d] = attitude (nominal, r3, yaw, yaw_rate);
  E = R' * D - D' * R;
  e_R = 0.5 * [E(3, 2); E(1, 3); E(2, 1)];
  if (u(4))
    integral_w = max (-1, min (1, integral_w + (r - p) * dt));
    integral_b = max (-0.3, min (0.3, integral_b + e_R * dt));
  end
  acceleration_d = zeros (3, 1);  % of the first input
  if (! isempty (before))
    acceleration_d = (omega_d - before) / dt;
  end
  before = omega_d;
  forward = R' * N * acceleration_d - cross (omega, R' * N * omega_d);
  back = KR .* e_R + KW .* (R' * N * omega_d - omega) + KF .* integral_b;
  torque = J .* (back + forward) + cross (omega, J .* omega);
  send (ours, typecast ([u(1); mass * (wanted' * R(:, 3)); torque]', "uint8"));
end
