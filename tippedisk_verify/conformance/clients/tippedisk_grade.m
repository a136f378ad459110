% Grades answers in GNU Octave or MATLAB, with the verdicts of `tippedisk-verify conformance grade`.
%
%     octave --eval "tippedisk_grade('answers.csv', 'truths.csv')"
function tippedisk_grade(answers, truths)
  % What agrees may be exact as well, and have more than 15 digits: doubles cannot tell.
  asked = columns_of(truths); given = columns_of(answers);
  if ~isfield(given, 'id') || ~isfield(given, 'answer'), error('no columns id and answer'), end
  if ~isfield(given, 'from'), given.from = repmat({''}, size(given.id)); end
  [is_known, at] = ismember(given.id, asked.id); said = ~cellfun(@isempty, given.answer);
  unknown = sum(said & ~is_known); lines = find(said & is_known); [places, first] = unique(at(lines), 'first');
  repeated = numel(lines) - numel(places); lines = lines(first);
  answer = repmat({''}, size(asked.id)); answer(places) = given.answer(lines); is_given = ~cellfun(@isempty, answer);
  from = answer; from(places) = lower(given.from(lines));
  from(cellfun(@isempty, from) & cellfun(@isempty, asked.value_from_doubles)) = {'decimals'};
  from(cellfun(@isempty, from)) = {'doubles'}; decimals = strcmp(from, 'decimals');
  if ~all(decimals | strcmp(from, 'doubles')), error('the column from says doubles or decimals'), end
  % An entry with nothing but NaN or NA has not been answered.
  matches = @(pattern) ~cellfun(@isempty, regexpi(answer, pattern, 'once'));
  missing = matches(['^([+-]?[qs]?nan(\([^)]*\)|f|16|32|64)?|[+-]?1\.#(([qs]nan|ind)0*|r|io)|\.nan|n/?a|<na>' ...
    '|null|nil|none|nothing|missing|undefined)$']);
  infinite = matches('^[+-]?(inf(inity)?(f|16|32|64)?|1\.#(inf0*|j)|\.inf)$');
  % Fortran leaves out the letter before an exponent of three digits; Mathematica writes *^ for it.
  number = regexprep(answer, '^([+-]?(?:\d+\.\d*|\.\d+))([+-]\d{3})$', '$1e$2');
  number = regexprep(number, '^([+-]?(?:\d+\.?\d*|\.\d+))(?:`{1,2}[\d.]*)?\*\^', '$1e');
  number = regexprep(regexprep(number, '`{1,2}[\d.]*$', ''), '[dDqQ]', 'e');
  is_number = ~cellfun(@isempty, regexpi(number, '^[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?$', 'once'));
  [~, ~, entry] = unique(regexprep(asked.id, '/[^/]*$', ''));
  some = accumarray(entry(:), double(is_given(:) & ~missing(:))) > 0; is_given(~some(entry)) = false;
  truth = str2double(asked.value_from_doubles); x = str2double(asked.value_from_decimals);
  truth(decimals) = x(decimals); needs = str2double(asked.digits_needed); scale = str2double(asked.scale);
  away = abs(str2double(number) - truth);
  digits = -log10(away ./ scale); digits(scale == 0) = 0; digits(away == 0) = 15; digits = min(digits, 15);
  verdict = repmat({'wrong'}, size(answer)); level = str2double(asked.level);
  verdict(digits >= needs / 2) = {'few-digits'};
  verdict(digits >= 1 & away <= str2double(asked.rounding)) = {'rounding'};
  verdict(digits >= needs) = {'agrees'};
  verdict(~is_number) = {'unreadable'}; verdict(missing | infinite) = {'not-a-number'};
  verdict(isnan(truth) | ~is_given) = {'no-truth'};
  failed = ismember(verdict, {'few-digits', 'wrong', 'unreadable', 'not-a-number'});
  for k = find(failed(:)).'
    fprintf('%-12s  %s  %s instead of %.17g\n', verdict{k}, asked.id{k}, answer{k}, truth(k));
  end
  for n = unique(level(:)).'
    here = level == n & ~strcmp(verdict, 'no-truth'); bad = sum(failed & here); says = 'fails';
    if ~any(here), says = 'not answered'; elseif bad == 0, says = 'agrees';
    elseif all(strcmp(verdict(failed & here), 'few-digits')), says = 'too few digits'; end
    if bad == 0 && any(here) && sum(here) < sum(level == n), says = 'partial'; end
    least = ''; if any(here), least = sprintf(', least digits %.1f', round(10 * min([digits(here), 15])) / 10 + 0); end
    fprintf('level %d: %d of %d answered, %d failed%s: %s\n', n, sum(here), sum(level == n), bad, least, says);
  end
  fprintf('%d unknown ids, %d repeated\n', unknown, repeated);
end

function columns = columns_of(file)
  text = strtrim(fileread(file)); lines = regexp(text, '\r?\n', 'split'); mark = ',';
  if ~any(lines{1} == ','), mark = char(9); if ~any(lines{1} == mark), mark = ';'; end, end
  comma = mark; if any(text == '"'), comma = [mark '(?=(?:[^"]*"[^"]*")*[^"]*$)']; end      % outside of quotes
  names = strtrim(regexp(lines{1}, comma, 'split')); fields = repmat({''}, numel(names), numel(lines) - 1);
  for k = 2:numel(lines)
    parts = regexp(lines{k}, comma, 'split');
    if numel(parts) > numel(names), error('line %d has %d fields: is there a decimal comma?', k, numel(parts)), end
    fields(1:numel(parts), k - 1) = parts;
  end
  fields = strtrim(fields); if numel(comma) > 1, fields = regexprep(fields, '^"(.*)"$', '$1'); end
  columns = cell2struct(num2cell(fields, 2), names, 1);
end
