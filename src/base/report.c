#include "ctsplat/report.h"

#include "base/enum_table.h"
#include "base/mem.h"
#include "base/text.h"
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

const char *const cts_severity_names[3] = {[CTS_NOTE] = "note", [CTS_WARNING] = "warning", [CTS_REFUSAL] = "refusal"};

CTS_ENUM_TABLE(char *const, cts_stage_names,
               CTS_N_STAGES, [CTS_STAGE_SCAN] = "scan", [CTS_STAGE_LABELS] = "labels", [CTS_STAGE_DECODE] = "decode",
               [CTS_STAGE_GREY] = "grey", [CTS_STAGE_CLASSIFY] = "classify", [CTS_STAGE_OCCLUSION] = "occlusion",
               [CTS_STAGE_FOOTPRINT] = "footprint", [CTS_STAGE_SPLAT] = "splat", [CTS_STAGE_COMPOSITE] = "composite",
               [CTS_STAGE_SHADE] = "shade", [CTS_STAGE_WARP] = "warp", [CTS_STAGE_EXPORT] = "export");

const char *const cts_label_source_names[CTS_N_LABEL_SOURCES] = {
    [CTS_LABEL_SEG] = "seg", [CTS_LABEL_RTSTRUCT] = "rtstruct", [CTS_LABEL_NIFTI] = "nifti"};

/* A report that runs out of memory loses a line, never the picture. */
void cts_report_free(CtsReport *report)
{
    if (!report)
        return;
    free(report->skips);
    free(report->plan);
    for (size_t i = 0; i < report->n_labels; i++)
        free(report->labels[i].name);
    free(report->labels);
    cts_diagnostics_free(&report->diagnostics);
    *report = (CtsReport){0};
}

void cts_report_stage(CtsReport *report, CtsStage stage, double wall_ms, double cpu_ms, uint64_t items, uint64_t bytes)
{
    if (!report)
        return;
    CtsStageTime *t = &report->stages[stage];
    t->ran = true;
    t->wall_ms += wall_ms;
    t->cpu_ms += cpu_ms;
    t->items += items;
    t->bytes += bytes;
}

void cts_report_label(CtsReport *report, const CtsLabelFact *label)
{
    if (!report || cts_grow(&report->labels, report->n_labels, NULL))
        return;
    CtsLabelFact *const added = &report->labels[report->n_labels];
    *added = *label;
    added->name = strdup(label->name);
    report->n_labels += added->name != NULL;
}

void cts_report_region(CtsReport *report, double wall_ms, double cpu_ms, const double busy[CTS_N_STAGES],
                       const uint64_t items[CTS_N_STAGES], const uint64_t bytes[CTS_N_STAGES])
{
    double sum = 0;
    for (int s = 0; s < CTS_N_STAGES; s++)
        sum += busy[s];
    for (int s = 0; s < CTS_N_STAGES && sum > 0; s++)
        if (busy[s] > 0)
            cts_report_stage(report, (CtsStage)s, wall_ms * busy[s] / sum, cpu_ms * busy[s] / sum, items ? items[s] : 0,
                             bytes ? bytes[s] : 0);
}

double cts_report_picture_cpu_ms(const CtsReport *report)
{
    double sum = -report->verified.cpu_ms;
    for (int s = CTS_STAGE_CLASSIFY; s <= CTS_STAGE_WARP; s++)
        sum += report->stages[s].cpu_ms;
    return sum > 0 ? sum : 0;
}

void cts_report_skip(CtsReport *report, const char *what, const char *why_format, ...)
{
    if (!report || cts_grow(&report->skips, report->n_skips, NULL))
        return;
    CtsSkip *skip = &report->skips[report->n_skips++];
    snprintf(skip->what, sizeof skip->what, "%s", what);
    va_list args;
    va_start(args, why_format);
    vsnprintf(skip->why, sizeof skip->why, why_format, args);
    va_end(args);
}

#define ROW(name, code, severity) {code, CTS_##severity},
static const struct {
    const char *code;
    CtsSeverity severity;
} diagnostic_rows[] = {CTS_DIAGNOSTIC_ROWS(ROW)};

__attribute__((format(printf, 3, 0))) static void add_diagnostic(CtsDiagnostics *diagnostics, CtsDiagnosticId id,
                                                                 const char *format, va_list args)
{
    if (cts_grow(&diagnostics->items, diagnostics->n, NULL))
        return;
    CtsDiagnostic *diagnostic = &diagnostics->items[diagnostics->n++];
    *diagnostic = (CtsDiagnostic){.id = id, .code = diagnostic_rows[id].code, .severity = diagnostic_rows[id].severity};
    vsnprintf(diagnostic->text, sizeof diagnostic->text, format, args);
    cts_text_clean(diagnostic->text);
}

void cts_report_diagnostic(CtsReport *report, CtsDiagnosticId id, const char *format, ...)
{
    if (!report)
        return;
    va_list args;
    va_start(args, format);
    add_diagnostic(&report->diagnostics, id, format, args);
    va_end(args);
}

void cts_diagnostics_add(CtsDiagnostics *diagnostics, CtsDiagnosticId id, const char *format, ...)
{
    va_list args;
    va_start(args, format);
    add_diagnostic(diagnostics, id, format, args);
    va_end(args);
}

const CtsDiagnostic *cts_diagnostics_find(const CtsDiagnostics *diagnostics, CtsDiagnosticId id)
{
    for (size_t i = 0; i < diagnostics->n; i++)
        if (diagnostics->items[i].id == id)
            return &diagnostics->items[i];
    return NULL;
}

void cts_diagnostics_free(CtsDiagnostics *diagnostics)
{
    free(diagnostics->items);
    *diagnostics = (CtsDiagnostics){0};
}

void cts_report_plan(CtsReport *report, const char *format, ...)
{
    enum { MAX_LINE = 1000 };
    char line[MAX_LINE], *longer;
    va_list args;
    va_start(args, format);
    vsnprintf(line, sizeof line, format, args);
    va_end(args);
    if (!report || asprintf(&longer, "%s%s\n", report->plan ? report->plan : "", line) < 0)
        return;
    free(report->plan);
    report->plan = longer;
}
