//! The style sheet. It refers to no other file.

/// Dark on white; figures in two widths, on paper two side by side; wide tables scroll.
pub(crate) const CSS: &str = "
:root { color-scheme: only light; }
* { box-sizing: border-box; }
body { margin: 0 auto; padding: 1.5rem 1.25rem 3rem; max-width: 50rem; background: #fff; color: #1a1a1a;
  font: 16px/1.5 'Liberation Sans', Arial, Helvetica, sans-serif; overflow-wrap: anywhere; }
h1 { font-size: 1.6rem; line-height: 1.25; margin: 0 0 .3rem; }
h2 { font-size: 1.25rem; margin: 2.4rem 0 .6rem; padding-bottom: .2rem; border-bottom: 2px solid #1a1a1a; }
h3 { font-size: 1.02rem; margin: 1.3rem 0 .2rem; }
p { margin: .35rem 0; }
.authors, .facts, .file, footer { color: #505050; }
.facts span:not(:last-child)::after { content: ' ·'; }
.file { font-size: .82rem; white-space: nowrap; }
.short { font-weight: bold; }
.banner, .warning { border: 2px solid #1a1a1a; border-left-width: 10px; padding: .5rem .8rem; margin: .8rem 0; }
.banner b { display: block; letter-spacing: .04em; }
.apart { border: 2px dashed #595959; padding: .2rem 1rem .9rem; margin-top: 2.4rem; background: #f6f6f6; }
.apart h2 { margin-top: 1rem; }
figure { margin: 1.4rem 0 2rem; }
figcaption { font-size: .92rem; margin-top: .3rem; }
svg { display: block; width: 100%; height: auto; }
.narrow { display: none; }
.scroll { overflow-x: auto; margin: .6rem 0; }
table { border-collapse: collapse; font-size: .9rem; font-variant-numeric: tabular-nums; overflow-wrap: normal; }
caption { text-align: left; font-weight: bold; padding-bottom: .3rem; }
th, td { padding: .22rem .6rem .22rem 0; text-align: right; vertical-align: top; white-space: nowrap; }
th, thead td { border-bottom: 1px solid #1a1a1a; }
td { border-bottom: 1px solid #ddd; }
th:first-child, td:first-child, .text { text-align: left; }
td:first-child { white-space: normal; min-width: 7.5rem; max-width: 23rem; overflow-wrap: anywhere; }
.text { white-space: normal; min-width: 12rem; }
tr.italic td { font-style: italic; }
code { font-family: 'Liberation Mono', Consolas, Menlo, monospace; font-size: .88em; }
ul { padding-left: 1.2rem; margin: .4rem 0; }
details { margin: .6rem 0; border: 1px solid #bbb; padding: .4rem .8rem; }
summary { font-weight: bold; cursor: pointer; }
.note { font-size: .9rem; color: #404040; }
dl { display: grid; grid-template-columns: max-content 1fr; gap: .15rem 1rem; margin: .5rem 0; }
dt { color: #505050; }
dd { margin: 0; }
blockquote { margin: .25rem 0; padding-left: .8rem; border-left: 3px solid #bbb; }
blockquote .who { font-size: .82rem; color: #505050; margin-right: .6em; }
footer { margin-top: 3rem; font-size: .85rem; border-top: 1px solid #bbb; padding-top: .5rem; }
@media (max-width: 44rem) {
  body { padding: 1rem .9rem 2rem; }
  .wide { display: none; }
  .narrow { display: block; }
  dl { grid-template-columns: 1fr; gap: 0; }
  dd { margin-bottom: .4rem; }
}
@media print {
  @page { size: A4; margin: 12mm 14mm; }
  html { font-size: 8.5pt; }
  body { max-width: none; padding: 0; font-size: 1rem; line-height: 1.3; }
  h1 { font-size: 15pt; }
  h2 { font-size: 11pt; margin: 4mm 0 1.2mm; }
  h3 { font-size: 9pt; margin: 2mm 0 .3mm; }
  p { margin: .6mm 0; }
  table, dl, .note, .comments, footer { font-size: 7.5pt; }
  th, td { padding: .2mm 2mm .2mm 0; }
  figcaption { font-size: 8pt; margin-top: 0; }
  dl { grid-template-columns: max-content 1fr max-content 1fr; gap: .3mm 3mm; margin: 1mm 0; }
  details { padding: .8mm 2mm; margin: 1.5mm 0; }
  blockquote { margin: .3mm 0; padding-left: 1.5mm; border-left-width: 1px; }
  .comments { columns: 3; column-gap: 4mm; }
  .comments h2, .comments > .note { column-span: all; }
  .banner, .warning { padding: 1.5mm 3mm; margin: 2mm 0; }
  .scroll { overflow: visible; margin: 2.5mm 0; }
  .whole { display: inline-block; vertical-align: top; margin-right: 8mm; }
  .apart { background: #fff; margin-top: 5mm; }
  .figures { columns: 2; column-gap: 5mm; }
  .wide { display: none; }
  .narrow { display: block; }
  figure { margin: 0 0 2.5mm; }
  figure svg { max-height: 200mm; }
  footer { margin-top: 5mm; }
  h2, h3, caption, summary { break-after: avoid; }
  figure, .banner, .warning, blockquote, tr, .whole { break-inside: avoid; }
}
";
