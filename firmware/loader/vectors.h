// The interrupt vectors, which lie in the loader's page: each one passes on to the application's own.
#ifndef VECTORS_H
#define VECTORS_H

#define VECTOR(number) void vector_##number(void) __interrupt(number) __naked

VECTOR(0);
VECTOR(1);
VECTOR(2);
VECTOR(3);
VECTOR(4);
VECTOR(5);
VECTOR(6);
VECTOR(7);
VECTOR(8);
VECTOR(9);
VECTOR(10);
VECTOR(11);
VECTOR(12);
VECTOR(13);
VECTOR(14);
VECTOR(15);
VECTOR(16);

#endif
