// Grades answers with the verdicts of `tippedisk-verify conformance grade`; what agrees may be exact as well, and
// have more than 15 digits: doubles cannot tell.
//
//     node grade.mjs answers.csv truths.csv
import { readFileSync } from 'node:fs';

const refuse = reason => { console.error(reason); process.exit(2); };
function rowsOf(file) {
  const lines = readFileSync(file, 'utf8').replace(/^\ufeff/, '').split(/\r?\n/);
  const mark = [',', '\t', ';'].find(c => lines[0].includes(c)) ?? ',';
  const comma = RegExp(`${mark}(?=(?:[^"]*"[^"]*")*[^"]*$)`);             // outside of quotes
  const split = line => line.split(comma).map(field => field.trim().replace(/^"(.*)"$/, '$1'));
  const names = split(lines[0]);
  return lines.slice(1).filter(line => line).map((line, k) => {
    const parts = split(line);
    if (parts.length > names.length) refuse(`line ${k + 2} has ${parts.length} fields: is there a decimal comma?`);
    return Object.fromEntries(names.map((name, i) => [name, parts[i] ?? '']));
  });
}
const [answers, truths] = process.argv.slice(2);
const asked = new Map(rowsOf(truths).map(row => [row.id, row])), given = new Map();
let unknown = 0, repeated = 0;
for (const { id, answer, from } of rowsOf(answers)) {
  if (id === undefined || answer === undefined) refuse('the first line must name the columns id and answer');
  if (!answer) continue;
  if (!asked.has(id)) { unknown++; continue; } else if (given.has(id)) { repeated++; continue; }
  const reading = from ? from.toLowerCase() : asked.get(id).value_from_doubles ? 'doubles' : 'decimals';
  if (!['doubles', 'decimals'].includes(reading)) refuse(`${id}: from says doubles or decimals`);
  given.set(id, { answer, reading });
}
// An entry with nothing but NaN or NA has not been answered.
const missing = RegExp(`^([+-]?[qs]?nan(\\([^)]*\\)|f|16|32|64)?|[+-]?1\\.#(([qs]nan|ind)0*|r|io)|\\.nan|n/?a|<na>`
  + '|null|nil|none|nothing|missing|undefined)$', 'i');
const infinite = /^[+-]?(inf(inity)?(f|16|32|64)?|1\.#(inf0*|j)|\.inf)$/i;
// Fortran leaves out the letter before an exponent of three digits; Mathematica writes *^ for it.
const plain = answer => answer.replace(/^([+-]?(?:\d+\.\d*|\.\d+))([+-]\d{3})$/, '$1e$2')
  .replace(/^([+-]?(?:\d+\.?\d*|\.\d+))(?:`{1,2}[\d.]*)?\*\^/, '$1e').replace(/`{1,2}[\d.]*$/, '').replace(/[dq]/i, 'e');
const entry = id => id.slice(0, id.lastIndexOf('/'));
const answered = new Set([...given].filter(([, { answer }]) => !missing.test(answer)).map(([id]) => entry(id)));
function verdictOf({ answer, reading }, row) {
  if (!row[`value_from_${reading}`]) return ['no-truth'];
  if (missing.test(answer) || infinite.test(answer)) return ['not-a-number'];
  const number = plain(answer);
  if (!/^[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?$/i.test(number)) return ['unreadable'];
  const away = Math.abs(Number(number) - row[`value_from_${reading}`]), needs = +row.digits_needed;
  const digits = away === 0 ? 15 : +row.scale === 0 ? 0 : Math.min(-Math.log10(away / row.scale), 15);
  if (digits >= needs) return ['agrees', digits];
  if (digits >= 1 && away <= +row.rounding) return ['rounding', digits];
  return [digits >= needs / 2 ? 'few-digits' : 'wrong', digits];
}
const levels = new Map([...asked.values()].map(({ level }) => [level, { asked: 0, n: 0, failed: 0, few: 0, least: 15 }]));
for (const [id, row] of asked) {
  const one = given.get(id), sum = levels.get(row.level); sum.asked++;
  const [verdict, digits = 15] = one && answered.has(entry(id)) ? verdictOf(one, row) : ['no-truth'];
  if (verdict === 'no-truth') continue;
  sum.n++; sum.least = Math.min(sum.least, digits);
  if (['agrees', 'rounding'].includes(verdict)) continue;
  sum.failed++; sum.few += verdict === 'few-digits';
  console.log(`${verdict.padEnd(12)}  ${id}  ${one.answer} instead of ${+row[`value_from_${one.reading}`]}`);
}
for (const [level, { asked, n, failed, few, least }] of levels) {
  const passes = n < asked ? 'partial' : 'agrees', fails = failed === few ? 'too few digits' : 'fails';
  const says = !n ? 'not answered' : failed ? fails : passes;
  const digits = n ? `, least digits ${least.toFixed(1).replace(/^-0\.0$/, '0.0')}` : '';
  console.log(`level ${level}: ${n} of ${asked} answered, ${failed} failed${digits}: ${says}`);
}
console.log(`${unknown} unknown ids, ${repeated} repeated`);
