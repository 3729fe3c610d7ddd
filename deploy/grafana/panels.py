"""The shape of a Grafana dashboard: what all panels have in common is said once, here."""

DATASOURCE = {"type": "prometheus", "uid": "prometheus"}
WIDTH = 24  # Of Grafana's grid.

# Units as Grafana calls them.
SECONDS, BYTES, RATIO, PER_SECOND, COUNT = "s", "bytes", "percentunit", "ops", "short"


def target(place, expression, legend):
    return {
        "datasource": DATASOURCE,
        "editorMode": "code",
        "expr": expression,
        "legendFormat": legend,
        "range": True,
        "refId": chr(ord("A") + place),
    }


def panel(kind, title, unit, description, queries, width, height, **options):
    """`queries`: pairs of an expression and the legend of its series."""
    return {
        "type": kind,
        "title": title,
        "description": description,
        "datasource": DATASOURCE,
        "gridPos": {"w": width, "h": height},
        "targets": [target(i, *query) for i, query in enumerate(queries)],
        "fieldConfig": {"defaults": {"unit": unit, **options.pop("defaults", {})}, "overrides": []},
        "options": options.pop("options", {}),
    }


def graph(title, unit, description, *queries, minimum=0, maximum=None, width=8):
    """Lines over time, with a legend that shows the last value."""
    defaults = {
        "color": {"mode": "palette-classic"},
        "custom": {"drawStyle": "line", "lineWidth": 1, "fillOpacity": 8, "showPoints": "never",
                   "spanNulls": False},
    }
    if minimum is not None:
        defaults["min"] = minimum
    if maximum is not None:
        defaults["max"] = maximum
    options = {
        "legend": {"displayMode": "table", "placement": "bottom", "calcs": ["lastNotNull"]},
        "tooltip": {"mode": "multi", "sort": "desc"},
    }
    return panel("timeseries", title, unit, description, queries, width, 8,
                 defaults=defaults, options=options)


def number(title, unit, description, expression, legend="", bad_above=None):
    """One large number, red above a bound."""
    steps = [{"color": "text", "value": None}]
    if bad_above is not None:
        steps.append({"color": "red", "value": bad_above})
    options = {
        "colorMode": "value",
        "graphMode": "area",
        "reduceOptions": {"calcs": ["lastNotNull"], "fields": "", "values": False},
        "textMode": "auto",
    }
    return panel("stat", title, unit, description, [(expression, legend)], 4, 4,
                 defaults={"thresholds": {"mode": "absolute", "steps": steps}}, options=options)


def bars(title, unit, description, expression, legend, width=12):
    """One bar for each series, of its last value."""
    options = {
        "displayMode": "basic",
        "orientation": "horizontal",
        "reduceOptions": {"calcs": ["lastNotNull"], "fields": "", "values": False},
    }
    return panel("bargauge", title, unit, description, [(expression, legend)], width, 8,
                 defaults={"color": {"mode": "palette-classic"}, "min": 0}, options=options)


def bar_chart(title, unit, description, expression, x, series, width=16):
    """Groups of bars over the label `x`, which holds numbers, with one bar in each for every value of the label `series`. The
    newest values: Grafana makes the table of them into one with a column for each series."""
    one = panel("barchart", title, unit, description, [(expression, f"{{{{{series}}}}}")], width, 10,
                defaults={"color": {"mode": "palette-classic"}, "min": 0, "max": 1,
                          "custom": {"fillOpacity": 80, "lineWidth": 1, "axisSoftMin": 0}},
                options={"xField": f"{x}\\{series}", "orientation": "vertical", "groupWidth": 0.7, "barWidth": 0.9,
                         "showValue": "always", "stacking": "none", "xTickLabelRotation": 0,
                         "legend": {"displayMode": "list", "placement": "bottom", "showLegend": True},
                         "tooltip": {"mode": "multi", "sort": "none"}})
    one["targets"][0].update({"format": "table", "instant": True, "range": False})
    one["transformations"] = [
        {"id": "convertFieldType",
         "options": {"conversions": [{"targetField": x, "destinationType": "number"}], "fields": {}}},
        {"id": "sortBy", "options": {"fields": {}, "sort": [{"field": x}]}},
        {"id": "groupingToMatrix",
         "options": {"rowField": x, "columnField": series, "valueField": "Value", "emptyValue": "null"}},
        {"id": "convertFieldType",
         "options": {"conversions": [{"targetField": f"{x}\\{series}", "destinationType": "string"}], "fields": {}}},
    ]
    return one


def row(title):
    return {"type": "row", "title": title, "collapsed": False, "panels": [],
            "gridPos": {"w": WIDTH, "h": 1}}


def quantiles(metric, labels, legend="{{run}}"):
    """The median and the 99th percentile of a histogram, as two queries."""
    by = ", ".join(["le", *labels])
    return [
        (f"histogram_quantile({q}, sum by ({by}) "
         f"(rate({metric}_bucket{{run=~\"$run\"}}[$__rate_interval])))", f"{legend} {name}")
        for q, name in ((0.5, "median"), (0.99, "p99"))
    ]


def place(panels):
    """Gives each panel its number and its place: from left to right, then down."""
    x = y = height = 0
    for i, one in enumerate(panels):
        grid = one["gridPos"]
        if x + grid["w"] > WIDTH:
            x, y, height = 0, y + height, 0
        one["id"] = i + 1
        grid["x"], grid["y"] = x, y
        x, height = x + grid["w"], max(height, grid["h"])
    return panels


def variable(name, label, query, many):
    return {
        "name": name,
        "label": label,
        "type": "query",
        "datasource": DATASOURCE,
        "definition": query,
        "query": {"query": query, "refId": "Variable"},
        "refresh": 2,
        "includeAll": many,
        "multi": many,
        "allValue": ".*" if many else None,
        "current": {"text": ["All"], "value": ["$__all"]} if many else {},
        "sort": 1,
    }


RUN = variable("run", "Run", "label_values(slalom_build_info, run)", True)
ACTOR = variable("name", "Actor",
                 'label_values(slalom_build_info{run=~"$run", role="actor"}, name)', True)

SWEEP = variable("sweep", "Sweep", "label_values(slalom_sweep_cells, sweep)", True)
COURSES = variable("courses", "Courses",
                   'label_values(slalom_sweep_success_rate{sweep=~"$sweep"}, courses)', True)
METHOD = variable("method", "Method",
                  'label_values(slalom_sweep_cell_state{sweep=~"$sweep"}, method)', True)


def dashboard(uid, title, description, panels, variables=(RUN,)):
    return {
        "uid": f"slalom-{uid}",
        "title": f"Slalom: {title}",
        "description": description,
        "tags": ["slalom"],
        "schemaVersion": 38,
        "version": 1,
        "editable": False,
        "graphTooltip": 1,
        "refresh": "5s",
        "time": {"from": "now-30m", "to": "now"},
        "timezone": "browser",
        "links": [{"type": "dashboards", "title": "Slalom", "tags": ["slalom"], "asDropdown": False,
                   "includeVars": True, "keepTime": True}],
        "templating": {"list": list(variables)},
        "annotations": {"list": []},
        "panels": place(panels),
    }
