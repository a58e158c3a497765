/* Where each variable is in the model's array, and where it starts; filled in by
 * `quadlab export fmu`. A vector has the name of its first number. */
#ifndef LAYOUT_H
#define LAYOUT_H

#define GUID "$guid"
#define START {$start}
#define SIZES {$sizes}

enum {
$places
    FIRST_TUNABLE = $tunable,
    FIRST_OUTPUT = $output,
    FIRST_INTEGER = $integer,
    COUNT = $count
};

#endif
