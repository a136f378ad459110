% Answers questions on parts of the right-hand side over a pipe (docs/protocol.md), in GNU Octave:
%
%     tippedisk-verify conformance run --levels 1 -- octave --no-gui --quiet answerer.m
1;
function q = model(p)
  rho = p.r + p.e * sin(p.gamma);
  q.w_y = rho * sin(p.beta);
  q.f_G = -p.m * p.g * rho * cos(p.beta);
  q.gamma_y = q.w_y * p.v - p.e * p.Omega * sin(p.beta)^2 * cos(p.gamma);
  q.gamma_rate = -p.Omega * cos(p.beta);
end
while true
  try, line = input('', 's'); catch, break, end      % fgetl would wait for the next line
  pairs = regexp(line, '"(\w+)": *"([^"]*)"', 'tokens');
  asked = struct(); numbers = struct();
  for k = 1:numel(pairs)
    asked.(pairs{k}{1}) = pairs{k}{2};
    numbers.(pairs{k}{1}) = str2double(pairs{k}{2});
  end
  answer = 'null';
  if strcmp(asked.kind, 'rhs')
    q = model(numbers);
    if isfield(q, asked.quantity), answer = sprintf('%.17g', q.(asked.quantity)); end
  end
  printf('{"id": "%s", "answer": %s, "from": "doubles"}\n', asked.id, answer);
  fflush(stdout);
end
