"""Style sheet of the report: light and dark by the reader's preference, one column on a phone."""

STYLE = """
:root{--paper:#f4f6f8;--card:#fff;--ink:#14181d;--quiet:#5b6570;--line:#dfe4ea;--stage:#eef1f4;
--accent:#2f6fde;--s0:#2f6fde;--s1:#d06a08;--s2:#0f8f6b;--s3:#8d4bd1;--right:#0f8f6b;--wrong:#c8372d;
--outline:#ffe14d;--box:#3ee0ff;color-scheme:light dark}
@media (prefers-color-scheme:dark){:root{--paper:#0e1115;--card:#171b21;--ink:#e9ecf0;--quiet:#98a3b0;--line:#2a313a;
--stage:#0f1318;--accent:#74a4ff;--s0:#74a4ff;--s1:#f2a359;--s2:#45c99e;--s3:#be8ff6;--right:#45c99e;--wrong:#ff7a70}}
*{box-sizing:border-box}
body{margin:0 auto;padding:16px;max-width:1200px;background:var(--paper);color:var(--ink);
font:15px/1.5 system-ui,-apple-system,"Segoe UI",Roboto,"DejaVu Sans",sans-serif}
h1,h2,p,figure,dl,dd,ul{margin:0}
h1{font-size:1rem;font-weight:600;color:var(--quiet);overflow-wrap:anywhere}
h2{font-size:.95rem;font-weight:600;margin-bottom:10px}
.card{background:var(--card);border:1px solid var(--line);border-radius:14px;padding:18px;min-width:0}
.quiet{color:var(--quiet);font-size:.87rem}
.head{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(100%,320px),1fr));gap:20px 40px;align-items:center}
.label{font-size:2.5rem;font-weight:700;line-height:1.15;letter-spacing:-.02em;overflow-wrap:anywhere}
.sure{color:var(--accent);font-weight:600;font-size:.6em;font-variant-numeric:tabular-nums}
.truth{display:inline-block;margin-top:6px;padding:1px 11px;border-radius:99px;border:1px solid;font-size:.87rem}
.right{color:var(--right)}.wrong{color:var(--wrong)}
.summary{display:flex;flex-wrap:wrap;gap:6px 26px;margin-top:14px}
.summary dt{color:var(--quiet);font-size:.78rem}
.summary dd{font-weight:600;font-variant-numeric:tabular-nums}
main{display:grid;gap:16px;margin-top:16px}
.grid{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(100%,320px),1fr));gap:16px}
table{border-collapse:collapse;width:100%;font-size:.9rem}
caption{text-align:left;font-weight:600;font-size:.95rem;padding-bottom:6px}
th{font-weight:500;text-align:left;padding:4px 12px 4px 0;vertical-align:top;overflow-wrap:anywhere}
td{padding:4px 0;vertical-align:middle}
tfoot th,tfoot td{border-top:1px solid var(--line);font-weight:600;padding-top:7px}
.bars th{min-width:6.4em}.bars td:nth-child(2){width:60%}
.number{text-align:right;padding-left:12px;font-variant-numeric:tabular-nums;white-space:nowrap}
.reasons td{font-variant-numeric:tabular-nums;color:var(--quiet)}
.bar{height:9px;border-radius:5px;background:var(--stage);overflow:hidden}
.fill{height:100%;min-width:2px;border-radius:5px;background:var(--accent)}
.f0{background:var(--s0)}.f1{background:var(--s1)}.f2{background:var(--s2)}.f3{background:var(--s3)}
.controls{display:flex;align-items:center;gap:14px;position:sticky;top:0;background:var(--card);padding:4px 0;z-index:2}
.controls input{flex:1;min-width:0;accent-color:var(--accent);height:28px}
.controls button{width:42px;height:42px;border:0;border-radius:50%;background:var(--accent);color:var(--card);
font-size:15px;cursor:pointer;flex:none}
.controls output{min-width:5.6em;text-align:right;font-weight:600;font-variant-numeric:tabular-nums}
#detail{min-height:1.5em;margin:2px 0 10px;font-variant-numeric:tabular-nums}
.stage{display:grid;grid-template-columns:minmax(0,3fr) minmax(0,2fr);gap:16px;align-items:start}
.cameras{display:grid;grid-template-columns:repeat(auto-fill,minmax(min(46%,180px),1fr));gap:12px}
.clouds{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(46%,190px),1fr));gap:12px}
.picture{position:relative;aspect-ratio:1;border-radius:9px;overflow:hidden;background:var(--stage)}
.picture img,.picture .over{position:absolute;inset:0;width:100%;height:100%;object-fit:contain}
.picture .place{position:absolute;right:5px;top:5px;width:20%;background:#0006;border-radius:2px;overflow:hidden}
.place rect{fill:#fff}
.outline{fill:none;stroke:var(--outline);stroke-width:1.6;stroke-linejoin:round;vector-effect:non-scaling-stroke;
filter:drop-shadow(0 0 1px #000a)}
.box{fill:none;stroke:var(--box);stroke-width:1.4;vector-effect:non-scaling-stroke}
figcaption{font-size:.8rem;color:var(--quiet);padding-top:3px;overflow-wrap:anywhere;font-variant-numeric:tabular-nums}
figcaption b{color:var(--ink);font-weight:600}
.absent img,.absent svg{visibility:hidden}
canvas{display:block;width:100%;aspect-ratio:1;border-radius:9px;background:var(--stage);color:var(--quiet)}
.key{display:flex;flex-wrap:wrap;gap:4px 18px;margin-top:10px;font-size:.82rem}
.swatch{display:inline-block;width:16px;height:10px;margin-right:6px;border:2px solid;border-radius:3px}
.swatch.outline{border-color:var(--outline);background:#8884}.swatch.box{border-color:var(--box);background:#8884}
.plot{display:block;width:100%;height:auto;font-size:13px}
.plot text{fill:var(--quiet)}.plot .grid{stroke:var(--line)}
.curve{fill:none;stroke-width:2.2;stroke-linejoin:round;stroke-linecap:round;stroke:var(--accent)}
.s0{stroke:var(--s0)}.s1{stroke:var(--s1)}.s2{stroke:var(--s2)}.s3{stroke:var(--s3)}
line.now{stroke:var(--ink);stroke-dasharray:3 3;opacity:.6}
circle.now{fill:var(--s1);stroke:var(--card);stroke-width:2}
.start{fill:var(--card);stroke:var(--accent);stroke-width:2}
.legend{list-style:none;padding:8px 0 0;display:flex;flex-wrap:wrap;gap:2px 16px;font-size:.84rem}
.legend i{display:inline-block;width:12px;height:12px;border-radius:3px;margin-right:6px;vertical-align:-1px}
.strip{display:flex;flex-wrap:wrap;gap:3px;margin-bottom:12px}
.strip i{width:11px;height:18px;border-radius:3px}
.used{background:var(--right)}.lost{border:2px solid var(--wrong)}
footer{padding:4px 4px 24px}footer p+p{margin-top:6px}
@media (max-width:760px){body{padding:10px}.card{padding:14px}.stage{grid-template-columns:minmax(0,1fr)}
.label{font-size:2.1rem}}
"""
