/* Answers questions on parts of the right-hand side over a pipe (docs/protocol.md), in C:
 *
 *     cc -O2 -std=c99 -o answerer answerer.c -lm
 *     tippedisk-verify conformance run --levels 1 -- ./answerer */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static char line[1 << 16], id[300], what[100], text[300];

static const char *field(const char *name, char *value, size_t space)   /* "" where the question has none */
{
    char key[100];
    snprintf(key, sizeof key, "\"%s\": \"", name);
    const char *found = strstr(line, key), *start = found ? found + strlen(key) : "";
    snprintf(value, space, "%.*s", (int)strcspn(start, "\""), start);
    return value;
}
static double number(const char *name) { return strtod(field(name, text, sizeof text), NULL); }

int main(void)
{
    while (fgets(line, sizeof line, stdin)) {
        double beta = number("beta"), gamma = number("gamma"), Omega = number("Omega"), e = number("e"), x = NAN;
        double rho = number("r") + e * sin(gamma);
        field("id", id, sizeof id), field("quantity", what, sizeof what);
        if (strcmp(what, "w_y") == 0) x = rho * sin(beta);
        if (strcmp(what, "f_G") == 0) x = -number("m") * number("g") * rho * cos(beta);
        if (strcmp(what, "gamma_rate") == 0) x = -Omega * cos(beta);
        if (strcmp(what, "gamma_y") == 0) x = rho * number("v") * sin(beta) - e * Omega * pow(sin(beta), 2) * cos(gamma);
        if (isnan(x)) printf("{\"id\": \"%s\", \"answer\": null}\n", id);
        else printf("{\"id\": \"%s\", \"answer\": %.17g, \"from\": \"doubles\"}\n", id, x);
        fflush(stdout);
    }
    return 0;
}
