// Links the charts of the page with its controls. Bokeh draws; nothing is asked of the network.
"use strict";
(function () {
  const data = JSON.parse(document.getElementById("data").textContent);
  const $ = (id) => document.getElementById(id);
  const cells = data.cells, n = cells.name.length, flat = data.axes.length < 2;
  const cutNames = Object.keys(data.cuts);
  const trees = cutNames.filter((name) => name !== "judge");
  const state = { cut: cutNames.includes("judge") ? "judge" : data.first, tree: data.first, shade: "class", row: null, slice: [], quiet: false };
  let source, model;

  const sum = (list) => list.reduce((a, b) => a + b, 0);
  const numberOf = (count, noun) => `${count} ${noun}${count === 1 ? "" : "s"}`;
  const cut = () => data.cuts[state.cut];

  function entropy(votes) {
    const total = sum(votes);
    return Math.abs(sum(votes.filter((v) => v > 0).map((v) => -v / total * Math.log2(v / total))));
  }

  function votesText(votes, looks) {
    const some = votes.map((v, i) => [v, looks[i]]).filter(([v]) => v > 0).sort((a, b) => b[0] - a[0]);
    return some.map(([v, look]) => `${look.sign} ${look.name} ${v}`).join(", ") || "none yet";
  }

  const isOpen = (row) => state.cut === "judge" && data.open[row];

  function className(row) {
    const look = cut().looks[cut().modal[row]];
    return look ? `${look.sign} ${look.name}${isOpen(row) ? " (not decided)" : ""}` : "no result yet";
  }

  function shareText(row) {
    const total = cells.results[row];
    return total ? `${Math.round(100 * cells.oscillating[row] / total)} %` : "";
  }

  function runsText(row) {
    const failed = cells.failed[row] ? `, ${cells.failed[row]} failed` : "";
    return `${cells.results[row]} of ${cells.total[row]} have a result${failed}`;
  }

  // Charts

  function drawMap() {
    const { looks, modal, votes } = cut();
    const blank = { colour: "#8a8a8a", line: "#8a8a8a", marker: "dot", pale: "#ffffff" };
    const plot = model("map");
    const across = (plot.inner_width || 300) / data.axes[0].values.length;
    const up = flat ? 40 : (plot.inner_height || 300) / data.axes[1].values.length;
    const size = Math.max(3, Math.min(15, 0.6 * Math.min(across, up)));
    const columns = { x: [], y: [], box: [], name: cells.name, class: [], votes: [], entropy: [], runs: [],
                      fill: [], alpha: [], colour: [], line: [], marker: [], size: [] };
    for (let row = 0; row < n; row++) {
      const look = looks[modal[row]] || blank;
      const bits = entropy(votes[row]);
      const winner = modal[row] < 0 ? 0 : votes[row][modal[row]] / sum(votes[row]);
      columns.x.push(cells.place[0][row]);
      columns.y.push(flat ? 1.17 : cells.place[1][row]);
      columns.box.push(flat ? 0.65 : cells.place[1][row]);
      columns.class.push(sum(votes[row]) ? `${className(row)} (${shareText(row)} oscillate)` : className(row));
      columns.votes.push(votesText(votes[row], looks));
      columns.entropy.push(bits.toFixed(3));
      columns.runs.push(runsText(row));
      columns.colour.push(isOpen(row) ? "#ffffff" : look.colour);
      columns.line.push(isOpen(row) ? look.colour : look.line);
      columns.marker.push(look.marker);
      columns.size.push(modal[row] < 0 ? 4 : size);
      if (flat) {
        columns.fill.push("#ffffff");
        columns.alpha.push(0);
      } else if (state.shade === "class") {
        columns.fill.push(look.pale);
        columns.alpha.push(0.25 + 0.75 * winner);
      } else {
        const share = state.shade === "entropy" ? bits / Math.log2(looks.length) : cells.results[row] / cells.total[row];
        columns.fill.push("#3f5f8f");
        columns.alpha.push(0.05 + 0.75 * share);
      }
    }
    source("cells").data = columns;
    if (flat) drawBars(looks, votes);
  }

  function drawBars(looks, votes) {
    const bars = { x: [], bottom: [], top: [], colour: [], hatch: [], class: [], name: [], share: [] };
    for (let row = 0; row < n; row++) {
      const total = sum(votes[row]);
      let height = 0;
      votes[row].forEach((v, i) => {
        if (!v) return;
        bars.x.push(cells.place[0][row]);
        bars.bottom.push(height);
        bars.top.push(height += v / total);
        bars.colour.push(looks[i].colour);
        bars.hatch.push(looks[i].hatch);
        bars.class.push(looks[i].name);
        bars.name.push(cells.name[row]);
        bars.share.push(v / total);
      });
    }
    source("bars").data = bars;
  }

  function drawPoints() {
    if (!source("points")) return;  // nothing oscillates
    const { looks, labels } = cut(), points = data.points;
    const look = labels.map((i) => looks[i]);
    source("points").data = {
      V_theta: points.V_theta, V_a: points.V_a, V_Omega: points.V_Omega, cell: points.row,
      name: points.row.map((row, i) => `${row < 0 ? "a cell that is not shown" : cells.name[row]}, seed ${points.seed[i]}`),
      class: look.map((l) => l.name), colour: look.map((l) => l.colour),
      line: look.map((l) => l.line), marker: look.map((l) => l.marker),
    };
  }

  function drawTree() {
    if (!data.tree.sizes.length) return;
    const { looks, leaves } = cut(), { depth } = data.cuts[state.tree], tree = data.tree;
    source("merges").data = {
      xs: tree.xs, ys: tree.ys,
      colour: tree.ends.map(([a, b]) => leaves[a] === leaves[b] ? looks[leaves[a]].colour : "#777777"),
    };
    const look = leaves.map((i) => looks[i]);
    source("leaves").data = {
      x: leaves.map((_, i) => i), y: leaves.map(() => 0), class: look.map((l) => l.name),
      colour: look.map((l) => l.colour), line: look.map((l) => l.line), marker: look.map((l) => l.marker),
      runs: tree.sizes,
    };
    model("cut").location = depth;
    $("tree-clusters").textContent = `${numberOf(state.tree, "cluster")} at depth ${Number(depth.toPrecision(3))}`;
    if ($("judged")) $("judged").hidden = state.cut !== "judge";
  }

  function drawLegend() {
    const { looks, sizes } = cut();
    const others = looks.map((_, i) => i < sizes.length ? sizes[i] : sum(cut().votes.map((v) => v[i])));
    $("legend").replaceChildren(...looks.flatMap((look, i) => {
      if (!others[i]) return [];
      const item = document.createElement("li"), sign = document.createElement("span");
      sign.className = "sign";
      sign.style.color = look.colour;
      sign.textContent = look.sign;
      item.append(sign, `${look.name}: ${numberOf(others[i], "run")}`);
      return [item];
    }));
    $("cut-words").textContent = state.tree;
  }

  function fillTable() {
    const body = document.querySelector("#table-of-cells tbody");
    if (!$("table-of-cells").open) return;
    body.replaceChildren(...cells.name.map((name, row) => {
      const line = document.createElement("tr"), button = document.createElement("button");
      button.type = "button";
      button.textContent = name;
      button.addEventListener("click", () => { choose(row); $("details").scrollIntoView(); });
      const votes = cut().votes[row];
      for (const content of [button, className(row), shareText(row), votesText(votes, cut().looks), entropy(votes).toFixed(3), runsText(row)]) {
        const box = document.createElement("td");
        box.append(content);
        line.append(box);
      }
      return line;
    }));
  }

  function drawAll() {
    drawMap();
    drawPoints();
    drawTree();
    drawLegend();
    fillTable();
    describe();
  }

  // Selection

  function select(rows, points) {
    state.quiet = true;
    source("cells").selected.indices = rows;
    if (source("points")) source("points").selected.indices = points;
    state.quiet = false;
  }

  function choose(row) {
    open(row, row === null ? [] : data.points.row.flatMap((r, i) => r === row ? [i] : []));
  }

  // The cell that the page opens with: a chimera's where there is one with a picture.
  function first() {
    const rows = [...Array(n).keys()], pictured = rows.filter((row) => data.plates[row]?.image);
    const chimera = pictured.find((row) => cut().looks[cut().modal[row]]?.name.startsWith("chimera"));
    return chimera ?? pictured[0] ?? rows.find((row) => cells.results[row]) ?? null;
  }

  function open(row, points = []) {
    state.row = row;
    select(row === null ? [] : [row], points);
    $("cell").value = row === null ? "" : String(row);
    showSlice(row);
    describe();
  }

  function pointsSelected(indices) {
    const rows = [...new Set(indices.map((i) => data.points.row[i]))].filter((row) => row >= 0);
    if (rows.length === 1) {
      state.row = rows[0];
      $("cell").value = String(rows[0]);
      select(rows, indices);
      describe();
      return;
    }
    state.row = null;
    $("cell").value = "";
    select(rows, indices);
    describe();
    if (indices.length) {
      $("details-name").textContent = `${numberOf(indices.length, "run")} in ${numberOf(rows.length, "cell")} chosen`;
      $("details-words").textContent = "Their cells have a frame on the map.";
    }
  }

  function describe() {
    const row = state.row, plate = row === null ? null : data.plates[row];
    $("run").hidden = !plate;
    if (row === null) {
      $("details-name").textContent = "No cell chosen";
      $("details-words").textContent = "Choose a cell to see one of its runs.";
      return;
    }
    const votes = cut().votes[row];
    $("details-name").textContent = cells.name[row];
    $("details-words").textContent = `${className(row)}${sum(votes) ? `; ${shareText(row)} of the runs oscillate` : ""}. Votes: ${votesText(votes, cut().looks)}; ` +
      `entropy ${entropy(votes).toFixed(3)} bits; ${runsText(row)}.` +
      (plate ? "" : cells.results[row] ? " This cell carries no picture: see the summary." : "");
    if (plate) showRun(plate);
  }

  function showRun(plate) {
    const look = cut().looks[plate.classes[state.cut]];
    const variations = plate.variations ? ` (V_θ, V_a, V_Ω) = (${plate.variations.join(", ")}).` : "";
    $("run-words").textContent = `The run ${plate.point}: ${look ? `${look.sign} ${look.name}. ` : ""}${plate.status}.${variations}` +
      (plate.image ? "" : " No picture: the store does not keep its series; the command show replays it.");
    $("has-picture").hidden = !plate.image;
    $("has-profiles").hidden = !plate.amplitude;
    if (plate.image) {
      const [from, to] = plate.t, [first, end] = plate.nodes;
      source("picture").data = { url: [plate.image], x: [from], y: [first - 0.5], w: [to - from], h: [end - first] };
      fit(model("picture").x_range, from, to);
      fit(model("picture").y_range, first - 0.5, end - 0.5);
      $("part").textContent = plate.part;
      $("low").textContent = `u = −${plate.largest}`;
      $("high").textContent = `${plate.largest}`;
    }
    if (plate.amplitude) {
      const columns = { node: plate.node };
      for (const name of ["amplitude", "phase", "frequency"]) {
        for (const end of ["", "_low", "_high"]) columns[name + end] = plate[name + end];
        setRange(model(name).y_range, Math.min(...plate[`${name}_low`]), Math.max(...plate[`${name}_high`]));
      }
      source("profile").data = columns;
    }
    drawNetwork(plate);
  }

  // The network is laid out once; only its colours belong to the run.
  function drawNetwork(plate) {
    if (!source("marks")) return;
    const drawn = data.networks[plate.network];
    $("has-network").hidden = !drawn;
    if (!drawn) return;
    for (const option of $("network-by").options) option.disabled = option.value !== "class" && !plate.amplitude;
    const by = plate.amplitude ? $("network-by").value : "class", values = plate[by];
    $("network-by").value = by;
    $("network-scale").hidden = !values;
    const at = (i) => [drawn.x[i], drawn.y[i]], columns = { xs: [], ys: [], colour: [], number: [], value: [] };
    const paint = values ? painter(by, values) : () => cut().looks[plate.classes[state.cut]]?.colour ?? "#8a8a8a";
    drawn.marks.forEach((corners, k) => {
      const [xs, ys] = [corners.map((i) => at(i)[0]), corners.map((i) => at(i)[1])];
      columns.xs.push(xs.length > 1 ? xs : xs[0]);
      columns.ys.push(ys.length > 1 ? ys : ys[0]);
      columns.colour.push(values ? paint(values[k]) : paint());
      columns.number.push(plate.node ? plate.node[k] : k);
      columns.value.push(values ? `${by} ${values[k]}` : "");
    });
    source("behind").data = { xs: drawn.behind.map((pair) => pair.map((i) => at(i)[0])), ys: drawn.behind.map((pair) => pair.map((i) => at(i)[1])) };
    source("marks").data = columns;
    $("network-part").textContent = drawn.partly;
  }

  function painter(by, values) {
    const palette = data.palettes[by === "phase" ? "twilight" : "viridis"], some = values.filter((v) => v !== null);
    const [low, high] = by === "phase" ? [-Math.PI, Math.PI] : [Math.min(...some), Math.max(...some)];
    // What is the same everywhere is to look so, whatever its last digits.
    const margin = high - low > 0.01 * Math.max(Math.abs(low), Math.abs(high)) ? 0 : 0.01 * Math.max(Math.abs(high), 1e-9);
    $("network-low").textContent = (low - margin).toPrecision(3);
    $("network-high").textContent = (high + margin).toPrecision(3);
    $("network-ramp").style.background = `linear-gradient(to right, ${palette.filter((_, i) => i % 9 === 0).join(", ")})`;
    const share = (v) => (v - low + margin) / (high - low + 2 * margin || 1);
    return (v) => v === null ? "#8a8a8a" : palette[Math.max(0, Math.min(palette.length - 1, Math.floor(share(v) * palette.length)))];
  }

  function setRange(range, low, high) {
    // Profiles that are the same at all nodes are to look flat, whatever their last digits.
    const margin = Math.max(0.06 * (high - low), 0.005 * Math.max(Math.abs(low), Math.abs(high)), 1e-9);
    fit(range, low - margin, high + margin);
  }

  function fit(range, start, end) {
    range.setv({ start, end, reset_start: start, reset_end: end });
  }

  // Controls

  function visible(row) {
    return state.slice.every((value, k) => value === undefined || cells.place[k][row] === value);
  }

  function applySlice() {
    const rows = [...Array(n).keys()].filter(visible);
    model("slice").indices = rows;
  }

  function showSlice(row) {
    const pickers = [...document.querySelectorAll(".slice")];
    if (row === null || !pickers.length || visible(row)) return;
    for (const picker of pickers) {
      const axis = Number(picker.dataset.axis);
      picker.value = String(cells.place[axis][row]);
      state.slice[axis] = cells.place[axis][row];
    }
    applySlice();
  }

  function setCut(name) {
    state.cut = name;
    if (name !== "judge") state.tree = name;
    if ($("by")) $("by").value = name === "judge" ? "judge" : "tree";
    $("cut").value = String(trees.indexOf(state.tree));
    $("cut").setAttribute("aria-valuetext", numberOf(state.tree, "cluster"));
    drawAll();
  }

  function cutAt(height) {
    const above = trees.map((name) => [Math.abs(data.cuts[name].depth - height), name]);
    setCut(above.sort((a, b) => a[0] - b[0])[0][1]);
  }

  function step(by) {
    const rows = [...Array(n).keys()].filter(visible);
    const at = rows.indexOf(state.row);
    choose(at < 0 ? rows[by > 0 ? 0 : rows.length - 1] : rows[(at + by + rows.length) % rows.length]);
  }

  function move(dx, dy) {
    if (state.row === null || flat) return step(dx || dy);
    const [x, y] = [cells.place[0], cells.place[1]], row = state.row;
    // The nearest cell in that direction; gaps, as outside a triangle, are stepped over.
    const ahead = [...Array(n).keys()].filter((i) => visible(i) &&
      (dx ? y[i] === y[row] && (x[i] - x[row]) * dx > 0 : x[i] === x[row] && (y[i] - y[row]) * dy > 0));
    ahead.sort((a, b) => Math.abs(x[a] - x[row]) + Math.abs(y[a] - y[row]) - Math.abs(x[b] - x[row]) - Math.abs(y[b] - y[row]));
    if (ahead.length) choose(ahead[0]);
  }

  const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };

  function connect(doc) {
    model = (name) => doc.get_model_by_name(name);
    source = (name) => model(`source-${name}`);
    cells.name.forEach((name, row) => $("cell").append(new Option(name, row)));
    $("cell").addEventListener("change", (event) => choose(event.target.value === "" ? null : Number(event.target.value)));
    $("previous").addEventListener("click", () => step(-1));
    $("next").addEventListener("click", () => step(1));
    $("cut").max = String(trees.length - 1);
    $("cut").disabled = trees.length < 2;
    $("cut").addEventListener("input", (event) => setCut(trees[Number(event.target.value)]));
    $("by")?.addEventListener("change", (event) => setCut(event.target.value === "judge" ? "judge" : state.tree));
    $("network-by")?.addEventListener("change", () => { if (state.row !== null && data.plates[state.row]) drawNetwork(data.plates[state.row]); });
    $("shade")?.addEventListener("change", (event) => { state.shade = event.target.value; drawMap(); });
    for (const picker of document.querySelectorAll(".slice")) {
      state.slice[Number(picker.dataset.axis)] = 0;
      picker.addEventListener("change", () => { state.slice[Number(picker.dataset.axis)] = Number(picker.value); applySlice(); });
    }
    $("map-keys").addEventListener("keydown", (event) => {
      const arrow = ARROWS[event.key];
      if (!arrow) return;
      event.preventDefault();
      move(...arrow);
    });
    $("table-of-cells").addEventListener("toggle", fillTable);
    const listen = (name, act) => {
      const selected = source(name)?.selected;
      selected?.properties.indices.change.connect(() => { if (!state.quiet) act([...selected.indices]); });
    };
    listen("cells", (rows) => choose(rows.length ? rows[0] : null));
    listen("points", pointsSelected);
    model("tree")?.on_event("tap", (event) => cutAt(event.y));
    model("map").properties.inner_width.change.connect(drawMap);
    setCut(state.cut);
    applySlice();
    open(first());
    document.documentElement.dataset.ready = "yes";
  }

  (function wait() {
    const doc = window.Bokeh && Bokeh.documents[0];
    if (doc && doc.is_idle) connect(doc); else setTimeout(wait, 20);
  })();
})();
